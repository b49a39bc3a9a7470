// Ten thousand random calls of the functions on trees in frames, right and wrong, for the sanitizers (scripts/sanitize.sh): every one answers BS_OK or BS_ERROR_ARGUMENT,
// or BS_ERROR_SNAPSHOT for a foreign file, and a world that was resumed reads as it did.
#include <cmath>
#include <cstdio>
#include <random>
#include <vector>

#include "../shim/bullet_shim.h"

namespace {

class Random {
 public:
  double within(double low, double high) { return std::uniform_real_distribution<double>(low, high)(engine_); }
  int32_t below(int32_t end) { return std::uniform_int_distribution<int32_t>(0, end - 1)(engine_); }
  bool once_in(int32_t times) { return below(times) == 0; }
  // Mostly a plain number, sometimes a strange one.
  double number() {
    const double odd[] = {0, -1, 1e300, -1e300, 1e-300, std::nan(""), HUGE_VAL};
    return once_in(12) ? odd[below(7)] : within(-1, 1);
  }
  void plain(double *values, int count) {
    for (int i = 0; i < count; ++i) values[i] = within(-1, 1);
  }
  void fill(double *values, int count) {
    for (int i = 0; i < count; ++i) values[i] = number();
  }

 private:
  std::mt19937_64 engine_{20261125};
};

bs_settings settings() {
  bs_settings s{};
  s.gravity[2] = -980;
  s.erp2 = 0.2;
  s.friction_erp = 0.2;
  s.linear_slop = 1e-5;
  s.warmstarting_factor = 0.1;
  s.least_squares_residual_threshold = 1e-7;
  s.solver_iterations = 50;
  return s;
}

bs_tree_body tree_body(Random &random, int32_t parent) {
  bs_tree_body body{};
  body.mass = random.within(0.5, 2);
  for (double *values : {body.position, body.inertial_position, body.box_position, body.axis}) random.plain(values, 3);
  for (double *values : {body.orientation, body.inertial_orientation, body.box_orientation}) random.plain(values, 4);
  for (double &extent : body.half_extents) extent = random.within(0.1, 1);
  body.friction = 0.5;
  body.collision_margin = body.compound_margin = 0.04;
  body.parent = parent;
  body.joint = random.once_in(3) ? BS_JOINT_FIXED : BS_JOINT_REVOLUTE;
  body.has_box = random.once_in(3) ? 0 : 1;
  // One field of some bodies is strange.
  double *fields[] = {&body.mass,         &body.position[1],     &body.orientation[2], &body.inertial_position[0], &body.inertial_orientation[3],
                      &body.box_position[2], &body.half_extents[1], &body.axis[0],        &body.friction,             &body.collision_margin};
  if (random.once_in(20)) *fields[random.below(10)] = random.number();
  if (random.once_in(60)) body.parent = random.below(9) - 2;
  if (random.once_in(60)) body.joint = random.below(6);
  return body;
}

bool add_tree(Random &random, bs_world *world, std::vector<int32_t> &links) {
  std::vector<bs_tree_body> bodies;
  const int32_t count = 1 + random.below(6);
  for (int32_t i = 0; i < count; ++i) bodies.push_back(tree_body(random, i - 2));
  bodies[0].parent = -1;
  int32_t index = -1;
  const int32_t code = bs_tree_add(world, bodies.data(), count, random.once_in(9) ? random.number() : 0.1, &index, nullptr, 0);
  if (code == BS_OK) links.push_back(count - 1);
  return code == BS_OK || code == BS_ERROR_ARGUMENT;
}

// One call on body `body` (which may not exist) of a world; false for an answer that is none.
bool call(Random &random, bs_world *world, const std::vector<int32_t> &links, const bs_world *other) {
  const int32_t body = random.below(int32_t(links.size()) + 2) - 1;
  const bool exists = body >= 0 && body < int32_t(links.size());
  const int32_t count = exists ? links[size_t(body)] : 3;
  const int32_t length = random.once_in(9) ? random.below(5) : count;
  const int32_t link = random.below(count + 3) - 1;
  std::vector<double> values(size_t(20 * (count + 6)));
  random.fill(values.data(), int(values.size()));
  std::vector<int32_t> some(size_t(length) + 1, link);
  int32_t code = BS_OK;
  switch (random.below(12)) {
    case 0: code = bs_motor_set(world, body, link, random.number(), random.number(), random.number()); break;
    case 1: code = bs_motor_impulses(world, body, values.data(), length); break;
    case 2: code = bs_joint_torques_add(world, body, some.data(), values.data(), length); break;
    case 3: code = bs_collider_frictions_set(world, body, link, values.data()); break;
    case 4: code = bs_dampings_set(world, body, values.data()); break;
    case 5: code = bs_joint_damping_set(world, body, link, random.number()); break;
    case 6: code = bs_base_reading(world, body, values.data(), random.once_in(9) ? 12 : 13); break;
    case 7: code = bs_link_readings(world, body, random.below(2), values.data(), 20 * length); break;
    case 8: code = bs_anchor_add(world, body, &values[0], &values[3], &values[7], &values[10], random.number(), nullptr, 0); break;
    case 9: {
      int32_t size = 0;
      if (bs_resume_size(random.once_in(3) ? other : world, &size) != BS_OK) return false;
      std::vector<double> data(size_t(size) + 1);
      code = bs_resume_take(random.once_in(3) ? other : world, data.data(), size, nullptr, 0);
      if (code == BS_OK) code = bs_resume_from(world, data.data(), random.once_in(5) ? size - 1 : size, nullptr, 0);
      break;
    }
    default: code = bs_world_step(world, 1e-3, nullptr, 0); break;
  }
  return code == BS_OK || code == BS_ERROR_ARGUMENT || code == BS_ERROR_SNAPSHOT;
}

}  // namespace

// The number of calls with an answer that is none; all of them if hardly a tree was built.
int random_trees(int calls) {
  Random random;
  int wrong = 0, trees = 0;
  for (int done = 0; done < calls;) {
    const bs_settings s = settings();
    bs_world *world = nullptr, *other = nullptr;
    if (bs_world_create(&s, &world, nullptr, 0) != BS_OK || bs_world_create(&s, &other, nullptr, 0) != BS_OK) return calls;
    std::vector<int32_t> links, elsewhere;
    wrong += add_tree(random, other, elsewhere) ? 0 : 1;
    for (int i = 0; i < 100; ++i, ++done) {
      const bool answered = random.once_in(25) ? add_tree(random, world, links) : call(random, world, links, other);
      wrong += answered ? 0 : 1;
    }
    trees += int(links.size());
    bs_world_destroy(world);
    bs_world_destroy(other);
  }
  std::printf("%d random calls, %d trees built\n", calls, trees);
  return trees > calls / 100 ? wrong : calls;
}
