// Exercises the shim's whole C interface without Rust, so that it can run under the sanitizers (scripts/sanitize.sh).
#include <atomic>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <limits>
#include <string>
#include <thread>
#include <vector>

#include "../shim/bullet_shim.h"
#include "../shim/impulse.h"

// In trees.cpp.
int random_trees(int calls);

namespace {

std::atomic<int> passed{0}, failed{0};

#define CHECK(condition)                                                              \
  do {                                                                                \
    if (condition) {                                                                  \
      ++passed;                                                                       \
    } else {                                                                          \
      ++failed;                                                                       \
      std::printf("%s:%d: CHECK failed: %s\n", __FILE__, __LINE__, #condition);       \
    }                                                                                 \
  } while (false)

constexpr double NOT_A_NUMBER = std::numeric_limits<double>::quiet_NaN();
constexpr double STEP = 1e-3;
constexpr int LINKS = 7;
using Numbers = std::vector<double>;

bool same_bits(const Numbers &a, const Numbers &b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(double)) == 0;
}

bs_settings settings() {
  bs_settings s{};
  s.gravity[2] = -980;
  s.erp2 = 0.08;
  s.friction_erp = 0.2;
  s.linear_slop = 1e-5;
  s.warmstarting_factor = 0.1;
  s.least_squares_residual_threshold = 1e-7;
  s.solver_iterations = 50;
  return s;
}

bs_link box(double mass, double x, double y, double z, int parent) {
  bs_link link{};
  link.mass = mass;
  link.half_extents[0] = x;
  link.half_extents[1] = y;
  link.half_extents[2] = z;
  link.axis[1] = 1;
  link.friction = 0.6;
  link.collision_margin = 0.01;
  link.parent = parent;
  return link;
}

// Boxes in a row on alternating hinges.
std::vector<bs_link> chain_links() {
  std::vector<bs_link> links;
  for (int i = 0; i < LINKS; ++i) {
    bs_link link = box(2 + 0.25 * i, 1, 0.8, 0.3, i - 1);
    link.parent_com_to_joint[0] = link.joint_to_com[0] = 1.1;
    if (i % 3 == 2) link.axis[0] = 0.6, link.axis[1] = 0.8;
    links.push_back(link);
  }
  return links;
}

struct World {
  bs_world *handle = nullptr;
  int32_t ground = -1, chain = -1, crate = -1, hanging = -1;
  explicit World(const bs_settings &s) { CHECK(bs_world_create(&s, &handle, nullptr, 0) == BS_OK); }
  ~World() { bs_world_destroy(handle); }
  World(const World &) = delete;
  World &operator=(const World &) = delete;
};

// Ground, a chain that jumps about, a crate that it pushes, and a body that is tied to the world above them.
void fill(World &world, bool with_ground_first = true, double crate_mass = 5, double half_width = 500) {
  const double extents[3] = {half_width, half_width, 10}, chain_at[3] = {0, 0, 0.6}, crate_at[3] = {6, 0.4, 2.2}, hanging_at[3] = {0, 8, 6};
  if (with_ground_first) CHECK(bs_ground_add(world.handle, extents, 0, 0.9, 0.5, 0.01, &world.ground, nullptr, 0) == BS_OK);
  const bs_link base = box(3, 1, 0.8, 0.3, -1), crate = box(crate_mass, 0.7, 0.7, 0.7, -1);
  const auto links = chain_links();
  CHECK(bs_multibody_add(world.handle, &base, links.data(), LINKS, chain_at, &world.chain, nullptr, 0) == BS_OK);
  CHECK(bs_multibody_add(world.handle, &crate, nullptr, 0, crate_at, &world.crate, nullptr, 0) == BS_OK);
  CHECK(bs_multibody_add(world.handle, &base, links.data(), 2, hanging_at, &world.hanging, nullptr, 0) == BS_OK);
  CHECK(bs_fixed_constraint_add(world.handle, world.hanging, 1e6, nullptr, 0) == BS_OK);
  if (!with_ground_first) CHECK(bs_ground_add(world.handle, extents, 0, 0.9, 0.5, 0.01, &world.ground, nullptr, 0) == BS_OK);
}

// Torques of a step: strokes that throw the chain off the ground and let it fall, on top of springs towards a moving pose.
void drive(World &world, int step, double scale = 1) {
  double angles[LINKS], rates[LINKS], torques[LINKS];
  CHECK(bs_joint_states(world.handle, world.chain, angles, rates, LINKS) == BS_OK);
  for (int i = 0; i < LINKS; ++i) {
    const double pose = 0.5 * std::sin(0.021 * step + 1.3 * i);
    torques[i] = scale * (2e4 * (pose - angles[i]) - 150 * rates[i] + (step % 400 < 40 ? (i % 2 == 0 ? 2e4 : -2e4) : 0));
  }
  CHECK(bs_joint_torques_set(world.handle, world.chain, torques, LINKS) == BS_OK);
}

// All that the interface tells about the world.
void observe(World &world, Numbers &out) {
  for (int32_t body : {world.chain, world.crate, world.hanging, world.ground}) {
    const int32_t links = body == world.chain ? LINKS : body == world.hanging ? 2 : 0;
    const size_t n = static_cast<size_t>(links);
    Numbers state(13 + 2 * n + 18 * n + 2);
    double *at = state.data();
    CHECK(bs_base_state(world.handle, body, at, 13) == BS_OK);
    CHECK(bs_joint_states(world.handle, body, at + 13, at + 13 + n, links) == BS_OK);
    CHECK(bs_link_states(world.handle, body, at + 13 + 2 * n, 18 * links) == BS_OK);
    CHECK(bs_velocity_clamp(world.handle, body, at + 13 + 20 * n, at + 14 + 20 * n) == BS_OK);
    out.insert(out.end(), state.begin(), state.end());
  }
  int32_t count = 0;
  CHECK(bs_contacts(world.handle, nullptr, 0, &count) == BS_OK);
  std::vector<bs_contact> contacts(static_cast<size_t>(count));
  CHECK(bs_contacts(world.handle, contacts.data(), count, &count) == BS_OK);
  out.push_back(count);
  for (const bs_contact &c : contacts) {
    for (const double *v : {c.position_on_b, c.normal_on_b, c.friction_direction_1, c.friction_direction_2}) {
      out.insert(out.end(), v, v + 3);
    }
    for (double r : {c.distance, c.normal_impulse, c.friction_impulse[0], c.friction_impulse[1]}) out.push_back(r);
    for (int32_t i : {c.body_a, c.link_a, c.body_b, c.link_b}) out.push_back(i);
  }
}

Numbers run(World &world, int from, int steps, double scale = 1) {
  Numbers out;
  for (int step = from; step < from + steps; ++step) {
    drive(world, step, scale);
    CHECK(bs_world_step(world.handle, STEP, nullptr, 0) == BS_OK);
    observe(world, out);
  }
  return out;
}

Numbers take(const World &world) {
  int32_t size = 0;
  CHECK(bs_snapshot_size(world.handle, &size) == BS_OK && size > 0);
  Numbers data(static_cast<size_t>(size));
  CHECK(bs_snapshot_take(world.handle, data.data(), size, nullptr, 0) == BS_OK);
  return data;
}

int32_t restore(World &world, const Numbers &data, std::string *message = nullptr) {
  char error[128] = "";
  const int32_t code = bs_snapshot_restore(world.handle, data.data(), static_cast<int32_t>(data.size()), error, sizeof error);
  if (message != nullptr) *message = error;
  return code;
}

int32_t contact_count(const World &world) {
  int32_t count = 0;
  CHECK(bs_contacts(world.handle, nullptr, 0, &count) == BS_OK);
  return count;
}

void identity() {
  CHECK(bs_abi_version() == BS_ABI_VERSION);
  CHECK(bs_scalar_size() == 8);
  CHECK(bs_linked_scalar_size() == 8);
  CHECK(bs_bullet_version() == 324);
  int32_t sizes[8] = {-1, -1, -1, -1, -1, -1, -1, -1};
  bs_layout(sizes, 3);
  CHECK(sizes[2] == int32_t(sizeof(bs_contact)) && sizes[3] == -1);
  bs_layout(sizes, 8);
  CHECK(sizes[0] == int32_t(sizeof(bs_settings)) && sizes[1] == int32_t(sizeof(bs_link)));
  CHECK(sizes[3] == int32_t(sizeof(bs_tree_body)));
  CHECK(sizes[6] == int32_t(offsetof(bs_contact, link_b)) && sizes[7] == int32_t(offsetof(bs_tree_body, reserved)));
}

void misuse() {
  bs_settings s = settings();
  bs_world *none = nullptr;
  char error[8];
  CHECK(bs_world_create(nullptr, &none, error, sizeof error) == BS_ERROR_ARGUMENT && std::strlen(error) == 7);
  CHECK(bs_world_create(&s, nullptr, nullptr, 0) == BS_ERROR_ARGUMENT);
  s.solver_iterations = 0;
  CHECK(bs_world_create(&s, &none, error, 0) == BS_ERROR_ARGUMENT && none == nullptr);
  bs_world_destroy(nullptr);
  s.solver_iterations = 50;
  World world(s);
  bs_world *w = world.handle;
  const double at[3] = {0, 0, 5}, extents[3] = {10, 10, 1}, flat[3] = {10, 0, 1};
  bs_link base = box(1, 1, 1, 1, -1);
  std::vector<bs_link> links = chain_links();
  int32_t body = -7, size = 0;
  auto add = [&](bs_world *in, const bs_link *b, const bs_link *l, int32_t n, const double *p, int32_t *out) {
    return bs_multibody_add(in, b, l, n, p, out, nullptr, 0);
  };
  CHECK(add(nullptr, &base, nullptr, 0, at, &body) == BS_ERROR_ARGUMENT);
  CHECK(add(w, nullptr, nullptr, 0, at, &body) == BS_ERROR_ARGUMENT);
  CHECK(add(w, &base, nullptr, 1, at, &body) == BS_ERROR_ARGUMENT);
  CHECK(add(w, &base, links.data(), -1, at, &body) == BS_ERROR_ARGUMENT);
  CHECK(add(w, &base, nullptr, 0, nullptr, &body) == BS_ERROR_ARGUMENT);
  CHECK(add(w, &base, nullptr, 0, at, nullptr) == BS_ERROR_ARGUMENT);
  auto refused = [&](auto spoil) {
    std::vector<bs_link> spoiled = links;
    spoil(spoiled[3]);
    return add(w, &base, spoiled.data(), LINKS, at, &body) == BS_ERROR_ARGUMENT;
  };
  CHECK(refused([](bs_link &l) { l.parent = 3; }));
  CHECK(refused([](bs_link &l) { l.parent = -2; }));
  CHECK(refused([](bs_link &l) { l.axis[1] = 2; }));
  CHECK(refused([](bs_link &l) { l.axis[0] = NOT_A_NUMBER; }));
  CHECK(refused([](bs_link &l) { l.mass = 0; }));
  CHECK(refused([](bs_link &l) { l.mass = NOT_A_NUMBER; }));
  CHECK(refused([](bs_link &l) { l.collision_margin = 0; }));
  CHECK(refused([](bs_link &l) { l.friction = -1; }));
  CHECK(refused([](bs_link &l) { l.restitution = 1.5; }));
  CHECK(refused([](bs_link &l) { l.restitution = NOT_A_NUMBER; }));
  CHECK(refused([](bs_link &l) { l.inertia[1] = 1; }));
  CHECK(refused([](bs_link &l) { l.inertia[0] = l.inertia[1] = l.inertia[2] = NOT_A_NUMBER; }));
  CHECK(refused([](bs_link &l) { l.com_to_box[2] = NOT_A_NUMBER; }));
  CHECK(refused([](bs_link &l) { l.half_extents[1] = 0; }));  // noticed when half the body is in the world
  CHECK(bs_ground_add(nullptr, extents, 0, 1, 0, 0.1, &body, nullptr, 0) == BS_ERROR_ARGUMENT);
  CHECK(bs_ground_add(w, nullptr, 0, 1, 0, 0.1, &body, nullptr, 0) == BS_ERROR_ARGUMENT);
  CHECK(bs_ground_add(w, flat, 0, 1, 0, 0.1, &body, nullptr, 0) == BS_ERROR_ARGUMENT);
  CHECK(bs_ground_add(w, extents, 0, -1, 0, 0.1, &body, nullptr, 0) == BS_ERROR_ARGUMENT);
  CHECK(bs_ground_add(w, extents, 0, 1, 0, 0, &body, nullptr, 0) == BS_ERROR_ARGUMENT);
  CHECK(bs_ground_add(w, extents, 0, 1, 0, 0.1, nullptr, nullptr, 0) == BS_ERROR_ARGUMENT);
  for (double restitution : {-0.1, 1.1, NOT_A_NUMBER}) {
    CHECK(bs_ground_add(w, extents, 0, 1, restitution, 0.1, &body, nullptr, 0) == BS_ERROR_ARGUMENT);
  }
  CHECK(body == -7);
  CHECK(bs_world_step(w, STEP, nullptr, 0) == BS_OK);  // an empty world, after all the refusals
  CHECK(restore(world, take(world)) == BS_OK);

  fill(world);
  CHECK(world.ground == 0 && world.chain == 1 && world.crate == 2 && world.hanging == 3);
  CHECK(bs_fixed_constraint_add(nullptr, 0, 1, nullptr, 0) == BS_ERROR_ARGUMENT);
  CHECK(bs_fixed_constraint_add(w, 4, 1, nullptr, 0) == BS_ERROR_ARGUMENT);
  CHECK(bs_fixed_constraint_add(w, 1, 0, nullptr, 0) == BS_ERROR_ARGUMENT);
  auto sprung = [](bs_world *in, int32_t index, const double *pivot, double compliance, double impulse) {
    return bs_sprung_constraint_add(in, index, pivot, compliance, 0, 0, impulse, nullptr, 0);
  };
  const double spoiled_pivot[3] = {0, NOT_A_NUMBER, 0};
  CHECK(sprung(nullptr, 3, at, 1e-6, 1) == BS_ERROR_ARGUMENT && sprung(w, 3, nullptr, 1e-6, 1) == BS_ERROR_ARGUMENT);
  CHECK(sprung(w, 4, at, 1e-6, 1) == BS_ERROR_ARGUMENT && sprung(w, 3, at, 1e-6, 0) == BS_ERROR_ARGUMENT);
  CHECK(sprung(w, 3, at, 0, 1) == BS_ERROR_ARGUMENT && sprung(w, 3, at, NOT_A_NUMBER, 1) == BS_ERROR_ARGUMENT);
  CHECK(sprung(w, 3, spoiled_pivot, 1e-6, 1) == BS_ERROR_ARGUMENT);
  CHECK(bs_sprung_constraint_add(w, 3, at, 1e-6, -1, 0, 1, nullptr, 0) == BS_ERROR_ARGUMENT);
  CHECK(bs_sprung_constraint_add(w, 3, at, 1e-6, NOT_A_NUMBER, 0, 1, nullptr, 0) == BS_ERROR_ARGUMENT);
  CHECK(bs_sprung_constraint_add(w, 3, at, 1e-6, 0, -1, 1, nullptr, 0) == BS_ERROR_ARGUMENT);
  CHECK(bs_sprung_constraint_add(w, 3, at, 1e-6, 0, NOT_A_NUMBER, 1, nullptr, 0) == BS_ERROR_ARGUMENT);
  CHECK(bs_constraint_shift_set(nullptr, 1, 1e-6, 0, nullptr, 0) == BS_ERROR_ARGUMENT);
  CHECK(bs_constraint_shift_set(w, 1, 0, 0, nullptr, 0) == BS_ERROR_ARGUMENT);
  CHECK(bs_constraint_shift_set(w, 1, 1e-6, NOT_A_NUMBER, nullptr, 0) == BS_ERROR_ARGUMENT);
  CHECK(bs_constraint_shift_set(w, 1, 1e-6, 0, nullptr, 0) == BS_ERROR_ARGUMENT);  // a body that nothing ties
  CHECK(sprung(w, world.crate, at, 1e-6, 1) == BS_ERROR_ARGUMENT);  // a body without links
  const double soft[BS_CLAMP_POINTS] = {1e-6, 1e-6, 1e-6, 1e-6, 1e-6, 1e-6, 1e-6}, rigid[BS_CLAMP_POINTS] = {1e-6, 1e-6, 1e-6, 1e-6, 1e-6, 0, 1e-6};
  auto bent = [&](const double *pivot, double width, const double *compliances, double damping, double impulse) {
    return bs_bent_constraint_add(w, 3, pivot, width, compliances, damping, impulse, nullptr, 0);
  };
  CHECK(bent(nullptr, 1, soft, 0, 1) == BS_ERROR_ARGUMENT && bent(at, 1, nullptr, 0, 1) == BS_ERROR_ARGUMENT);
  CHECK(bent(at, 0, soft, 0, 1) == BS_ERROR_ARGUMENT && bent(at, NOT_A_NUMBER, soft, 0, 1) == BS_ERROR_ARGUMENT);
  CHECK(bent(at, 1, rigid, 0, 1) == BS_ERROR_ARGUMENT && bent(at, 1, soft, -1, 1) == BS_ERROR_ARGUMENT);
  CHECK(bent(at, 1, soft, 0, 0) == BS_ERROR_ARGUMENT && bent(spoiled_pivot, 1, soft, 0, 1) == BS_ERROR_ARGUMENT);
  for (double step : {0.0, -STEP, NOT_A_NUMBER}) CHECK(bs_world_step(w, step, nullptr, 0) == BS_ERROR_ARGUMENT);
  CHECK(bs_world_step(nullptr, STEP, nullptr, 0) == BS_ERROR_ARGUMENT);
  CHECK(bs_world_set_gravity(w, nullptr) == BS_ERROR_ARGUMENT && bs_world_set_gravity(nullptr, at) == BS_ERROR_ARGUMENT);
  Numbers a(200, 0.0), b(200, 0.0);
  for (int32_t index : {-1, 4, std::numeric_limits<int32_t>::max(), std::numeric_limits<int32_t>::min()}) {
    CHECK(bs_joint_states(w, index, a.data(), b.data(), LINKS) == BS_ERROR_ARGUMENT);
    CHECK(bs_joint_states_set(w, index, a.data(), b.data(), LINKS) == BS_ERROR_ARGUMENT);
    CHECK(bs_joint_torques_set(w, index, a.data(), LINKS) == BS_ERROR_ARGUMENT);
    CHECK(bs_forces_add(w, index, a.data(), 6 * (LINKS + 1)) == BS_ERROR_ARGUMENT);
    CHECK(bs_frictions_set(w, index, a.data(), LINKS + 1) == BS_ERROR_ARGUMENT);
    CHECK(bs_base_state(w, index, a.data(), 13) == BS_ERROR_ARGUMENT);
    CHECK(bs_base_state_set(w, index, a.data(), 13) == BS_ERROR_ARGUMENT);
    CHECK(bs_link_states(w, index, a.data(), 18 * LINKS) == BS_ERROR_ARGUMENT);
    CHECK(bs_velocity_clamp(w, index, a.data(), b.data()) == BS_ERROR_ARGUMENT);
  }
  for (int32_t off : {-1, 1}) {
    CHECK(bs_joint_states(w, 1, a.data(), b.data(), LINKS + off) == BS_ERROR_ARGUMENT);
    CHECK(bs_joint_states_set(w, 1, a.data(), b.data(), LINKS + off) == BS_ERROR_ARGUMENT);
    CHECK(bs_joint_torques_set(w, 1, a.data(), LINKS + off) == BS_ERROR_ARGUMENT);
    CHECK(bs_forces_add(w, 1, a.data(), 6 * (LINKS + 1) + off) == BS_ERROR_ARGUMENT);
    CHECK(bs_frictions_set(w, 1, a.data(), LINKS + 1 + off) == BS_ERROR_ARGUMENT);
    CHECK(bs_base_state(w, 1, a.data(), 13 + off) == BS_ERROR_ARGUMENT);
    CHECK(bs_base_state_set(w, 1, a.data(), 13 + off) == BS_ERROR_ARGUMENT);
    CHECK(bs_link_states(w, 1, a.data(), 18 * LINKS + off) == BS_ERROR_ARGUMENT);
  }
  CHECK(bs_joint_states(w, 1, nullptr, b.data(), LINKS) == BS_ERROR_ARGUMENT);
  CHECK(bs_joint_states(w, 1, a.data(), nullptr, LINKS) == BS_ERROR_ARGUMENT);
  CHECK(bs_joint_states_set(w, 1, nullptr, b.data(), LINKS) == BS_ERROR_ARGUMENT);
  CHECK(bs_joint_torques_set(w, 1, nullptr, LINKS) == BS_ERROR_ARGUMENT);
  CHECK(bs_forces_add(w, 1, nullptr, 6 * (LINKS + 1)) == BS_ERROR_ARGUMENT && bs_forces_add(nullptr, 1, a.data(), 6) == BS_ERROR_ARGUMENT);
  CHECK(bs_frictions_set(w, 1, nullptr, LINKS + 1) == BS_ERROR_ARGUMENT);
  CHECK(bs_frictions_set(nullptr, 1, a.data(), LINKS + 1) == BS_ERROR_ARGUMENT);
  b[LINKS] = -1;
  CHECK(bs_frictions_set(w, 1, b.data(), LINKS + 1) == BS_ERROR_ARGUMENT);
  CHECK(bs_base_state(w, 1, nullptr, 13) == BS_ERROR_ARGUMENT && bs_base_state(nullptr, 1, a.data(), 13) == BS_ERROR_ARGUMENT);
  CHECK(bs_base_state_set(w, 1, nullptr, 13) == BS_ERROR_ARGUMENT);
  CHECK(bs_base_state_set(w, 1, a.data(), 13) == BS_ERROR_ARGUMENT);  // a quaternion of zeros
  CHECK(bs_link_states(w, 1, nullptr, 18 * LINKS) == BS_ERROR_ARGUMENT);
  CHECK(bs_link_states(nullptr, 1, a.data(), 18 * LINKS) == BS_ERROR_ARGUMENT);
  CHECK(bs_velocity_clamp(w, 1, nullptr, a.data()) == BS_ERROR_ARGUMENT);
  CHECK(bs_velocity_clamp(w, 1, a.data(), nullptr) == BS_ERROR_ARGUMENT);
  CHECK(bs_contacts(nullptr, nullptr, 0, &size) == BS_ERROR_ARGUMENT && bs_contacts(w, nullptr, 0, nullptr) == BS_ERROR_ARGUMENT);
  CHECK(bs_contacts(w, nullptr, 1, &size) == BS_ERROR_ARGUMENT && bs_contacts(w, nullptr, -1, &size) == BS_OK);
  CHECK(bs_snapshot_size(nullptr, &size) == BS_ERROR_ARGUMENT && bs_snapshot_size(w, nullptr) == BS_ERROR_ARGUMENT);
  CHECK(bs_snapshot_size(w, &size) == BS_OK);
  a.assign(static_cast<size_t>(size), 0);
  CHECK(bs_snapshot_take(nullptr, a.data(), size, nullptr, 0) == BS_ERROR_ARGUMENT);
  CHECK(bs_snapshot_take(w, nullptr, size, nullptr, 0) == BS_ERROR_ARGUMENT);
  CHECK(bs_snapshot_take(w, a.data(), size - 1, nullptr, 0) == BS_ERROR_ARGUMENT);
  CHECK(bs_snapshot_take(w, a.data(), -1, nullptr, 0) == BS_ERROR_ARGUMENT);
  CHECK(bs_snapshot_take(w, a.data(), size, nullptr, 0) == BS_OK);
  CHECK(bs_snapshot_restore(nullptr, a.data(), size, nullptr, 0) == BS_ERROR_ARGUMENT);
  CHECK(bs_snapshot_restore(w, nullptr, size, nullptr, 0) == BS_ERROR_ARGUMENT);
  CHECK(bs_snapshot_restore(w, a.data(), -1, nullptr, 0) == BS_ERROR_ARGUMENT);
}

void reading_and_writing() {
  World world(settings());
  fill(world);
  Numbers set(2 * LINKS), got(2 * LINKS), base = {1, 2, 30, 0, 0, 0.6, 0.8, 4, 5, 6, 0.1, 0.2, 0.3}, back(13);
  for (size_t i = 0; i < set.size(); ++i) set[i] = 0.1 * double(i) - 0.3;
  CHECK(bs_joint_states_set(world.handle, world.chain, set.data(), set.data() + LINKS, LINKS) == BS_OK);
  CHECK(bs_joint_states(world.handle, world.chain, got.data(), got.data() + LINKS, LINKS) == BS_OK);
  CHECK(same_bits(set, got));
  CHECK(bs_base_state_set(world.handle, world.chain, base.data(), 13) == BS_OK);
  CHECK(bs_base_state(world.handle, world.chain, back.data(), 13) == BS_OK);
  for (size_t i = 0; i < 13; ++i) CHECK(back[i] == base[i]);
  double limit = 0, largest = 0;
  CHECK(bs_velocity_clamp(world.handle, world.chain, &limit, &largest) == BS_OK && limit == 100 && largest == 6);

  // A crate in free fall, then one that gravity has let go.
  const double nothing[3] = {0, 0, 0};
  const double up[13] = {100, 100, 500, 0, 0, 0, 1};
  CHECK(bs_base_state_set(world.handle, world.crate, up, 13) == BS_OK);
  CHECK(bs_world_step(world.handle, STEP, nullptr, 0) == BS_OK);
  CHECK(bs_base_state(world.handle, world.crate, back.data(), 13) == BS_OK);
  CHECK(std::abs(back[9] + 0.98) < 1e-12 && std::abs(back[2] - (500 - 0.98e-3)) < 1e-9);
  const double speed = back[9];
  CHECK(bs_world_set_gravity(world.handle, nothing) == BS_OK);
  CHECK(bs_world_step(world.handle, STEP, nullptr, 0) == BS_OK);
  CHECK(bs_base_state(world.handle, world.crate, back.data(), 13) == BS_OK && back[9] == speed);
}

// Forces from outside, masses beside their boxes, friction and restitution of single bodies, a tie that gives.
void beyond_plain_boxes() {
  const double ground[3] = {500, 500, 10}, nothing[3] = {0, 0, 0}, high[3] = {0, 0, 40}, low[3] = {0, 0, 1};
  int32_t body = -1, floor = -1;
  Numbers state(13), wrench = {6, 0, 0, 0, 0, 0};
  auto base_of = [&](World &world, int32_t index) { CHECK(bs_base_state(world.handle, index, state.data(), 13) == BS_OK); };

  // A force of 6 on a mass of 3 for one step, then none; pending forces belong to a snapshot.
  World free(settings());
  const bs_link crate = box(3, 1, 1, 1, -1);
  CHECK(bs_multibody_add(free.handle, &crate, nullptr, 0, high, &body, nullptr, 0) == BS_OK);
  CHECK(bs_world_set_gravity(free.handle, nothing) == BS_OK);
  CHECK(bs_forces_add(free.handle, body, wrench.data(), 6) == BS_OK);
  const Numbers pending = take(free);
  for (int round = 0; round < 2; ++round) {
    for (int step = 0; step < 2; ++step) CHECK(bs_world_step(free.handle, STEP, nullptr, 0) == BS_OK);
    base_of(free, body);
    CHECK(std::abs(state[7] - 2 * STEP) < 1e-15);
    CHECK(bs_forces_add(free.handle, body, wrench.data(), 6) == BS_OK);
    CHECK(restore(free, pending) == BS_OK);
  }

  // The same as a mass that is not at the centre of its box: the box lands before it, and the mass keeps its inertia.
  bs_link heavy = crate;
  heavy.com_to_box[0] = 0.4;
  heavy.inertia[0] = heavy.inertia[1] = heavy.inertia[2] = 5;
  World leaning(settings());
  CHECK(bs_multibody_add(leaning.handle, &heavy, nullptr, 0, low, &body, nullptr, 0) == BS_OK);
  CHECK(bs_ground_add(leaning.handle, ground, 0, 1, 0, 0.01, &floor, nullptr, 0) == BS_OK);
  for (int step = 0; step < 500; ++step) CHECK(bs_world_step(leaning.handle, STEP, nullptr, 0) == BS_OK);
  int32_t count = 0;
  std::vector<bs_contact> contacts(4);
  CHECK(bs_contacts(leaning.handle, contacts.data(), 4, &count) == BS_OK && count == 4);
  double left = 0, right = 0;
  for (const bs_contact &c : contacts) (c.position_on_b[0] < 0.4 ? left : right) += c.normal_impulse;
  // Edges at -0.6 and 1.4 from the mass bear 0.7 and 0.3 of it.
  CHECK(std::abs(left / (3 * 980 * STEP) - 0.7) < 1e-3 && std::abs(right / (3 * 980 * STEP) - 0.3) < 1e-3);
  World fresh(settings());
  CHECK(bs_multibody_add(fresh.handle, &heavy, nullptr, 0, low, &body, nullptr, 0) == BS_OK);
  CHECK(bs_ground_add(fresh.handle, ground, 0, 1, 0, 0.01, &floor, nullptr, 0) == BS_OK);
  CHECK(restore(fresh, take(leaning)) == BS_OK && same_bits(take(fresh), take(leaning)));

  // Friction that is set acts at once, and is no part of a snapshot.
  const double low_friction = 0.1;
  const Numbers still = take(leaning);
  const double aslant[3] = {300, 0, -980};
  CHECK(bs_world_set_gravity(leaning.handle, aslant) == BS_OK);
  for (int step = 0; step < 100; ++step) CHECK(bs_world_step(leaning.handle, STEP, nullptr, 0) == BS_OK);
  base_of(leaning, body);
  CHECK(std::abs(state[7]) < 1e-3);
  CHECK(bs_frictions_set(leaning.handle, body, &low_friction, 1) == BS_OK);
  for (int step = 0; step < 100; ++step) CHECK(bs_world_step(leaning.handle, STEP, nullptr, 0) == BS_OK);
  base_of(leaning, body);
  CHECK(std::abs(state[7] / (0.1 * (300 - 0.1 * 980)) - 1) < 0.01);
  CHECK(restore(leaning, still) == BS_OK);

  // A bounce of a chain goes off with the product of the two restitutions.
  bs_link link = box(3, 1, 1, 1, -1);
  link.parent_com_to_joint[0] = link.joint_to_com[0] = 1;
  bs_link ball = crate, second = link;
  ball.restitution = second.restitution = 0.8;
  World bouncing(settings());
  const double dropped[3] = {0, 0, 2};
  CHECK(bs_multibody_add(bouncing.handle, &ball, &second, 1, dropped, &body, nullptr, 0) == BS_OK);
  CHECK(bs_ground_add(bouncing.handle, ground, 0, 1, 0.5, 0.01, &floor, nullptr, 0) == BS_OK);
  double fastest_down = 0, fastest_up = 0;
  for (int step = 0; step < 700; ++step) {
    CHECK(bs_world_step(bouncing.handle, 1e-4, nullptr, 0) == BS_OK);
    base_of(bouncing, body);
    fastest_down = std::fmin(fastest_down, state[9]), fastest_up = std::fmax(fastest_up, state[9]);
  }
  // Within what gravity adds in a step.
  CHECK(std::abs(fastest_up + 0.4 * fastest_down) < 980e-4 && fastest_down < -44);

  // A tie that gives turns by its compliance times the moment: of two boxes of 3 that reach from the pivot to 4.
  World hanging(settings());
  const double pivot[3] = {-1, 0, 0};
  CHECK(bs_multibody_add(hanging.handle, &crate, &link, 1, high, &body, nullptr, 0) == BS_OK);
  CHECK(bs_sprung_constraint_add(hanging.handle, body, pivot, 1e-7, 0, 0, 1e6, nullptr, 0) == BS_OK);
  double angle = 0, rate = 0, torque = 0;
  for (int step = 0; step < 4000; ++step) {
    CHECK(bs_joint_states(hanging.handle, body, &angle, &rate, 1) == BS_OK);
    torque = -1e6 * (angle + 5e-3 * rate);
    CHECK(bs_joint_torques_set(hanging.handle, body, &torque, 1) == BS_OK);
    CHECK(bs_world_step(hanging.handle, 1e-4, nullptr, 0) == BS_OK);
  }
  base_of(hanging, body);
  // A turn about y by phi is a quaternion with sin(phi/2); the moment is 6 * 980 * 2, less by the cosine of small angles.
  CHECK(std::abs(2 * std::asin(state[4]) / (1e-7 * 6 * 980 * 2) - 1) < 1e-3);
  CHECK(std::abs(state[0] - (std::cos(2 * std::asin(state[4])) - 1)) < 1e-5);
  const Numbers hung = take(hanging);
  World stiffer(settings());
  CHECK(bs_multibody_add(stiffer.handle, &crate, &link, 1, high, &body, nullptr, 0) == BS_OK);
  CHECK(bs_sprung_constraint_add(stiffer.handle, body, pivot, 2e-7, 0, 0, 1e6, nullptr, 0) == BS_OK);
  CHECK(restore(stiffer, hung) == BS_ERROR_SNAPSHOT);
  World damped(settings());
  CHECK(bs_multibody_add(damped.handle, &crate, &link, 1, high, &body, nullptr, 0) == BS_OK);
  CHECK(bs_sprung_constraint_add(damped.handle, body, pivot, 1e-7, 1e-3, 0, 1e6, nullptr, 0) == BS_OK);
  CHECK(restore(damped, hung) == BS_ERROR_SNAPSHOT);
  World harder(settings());
  CHECK(bs_multibody_add(harder.handle, &crate, &link, 1, high, &body, nullptr, 0) == BS_OK);
  CHECK(bs_sprung_constraint_add(harder.handle, body, pivot, 1e-7, 0, 100, 1e6, nullptr, 0) == BS_OK);
  CHECK(restore(harder, hung) == BS_ERROR_SNAPSHOT);
  World bent(settings());
  const double compliances[BS_CLAMP_POINTS] = {1e-7, 1e-7, 1e-7, 1e-7, 1e-7, 1e-7, 1e-7};
  CHECK(bs_multibody_add(bent.handle, &crate, &link, 1, high, &body, nullptr, 0) == BS_OK);
  CHECK(bs_bent_constraint_add(bent.handle, body, pivot, 1e4, compliances, 0, 1e6, nullptr, 0) == BS_OK);
  CHECK(restore(bent, hung) == BS_ERROR_SNAPSHOT);
  World shifting(settings());
  CHECK(bs_multibody_add(shifting.handle, &crate, &link, 1, high, &body, nullptr, 0) == BS_OK);
  CHECK(bs_sprung_constraint_add(shifting.handle, body, pivot, 1e-7, 0, 0, 1e6, nullptr, 0) == BS_OK);
  CHECK(bs_constraint_shift_set(shifting.handle, body, 1e-7, 0, nullptr, 0) == BS_OK);
  CHECK(restore(shifting, hung) == BS_ERROR_SNAPSHOT);
}

// A driven world in mid-jump, with some contacts left.
constexpr int BEFORE = 650;
int32_t step_into_flight(World &world) {
  run(world, 0, BEFORE);
  return contact_count(world);
}

void continuation(bool ground_first, double half_width, int steps) {
  World world(settings());
  fill(world, ground_first, 5, half_width);
  const int32_t contacts = step_into_flight(world);
  CHECK(contacts > 0);
  drive(world, BEFORE, 0.5);  // torques that wait for the next step belong to the snapshot
  const Numbers snapshot = take(world);
  CHECK(same_bits(snapshot, take(world)));
  auto go_on = [steps](World &in) {
    Numbers out;
    CHECK(bs_world_step(in.handle, STEP, nullptr, 0) == BS_OK);
    observe(in, out);
    const Numbers rest = run(in, BEFORE + 1, steps);
    out.insert(out.end(), rest.begin(), rest.end());
    return out;
  };
  const Numbers expected = go_on(world);
  std::printf("ground %s, %g wide: %d contacts in the snapshot of %zu numbers, %zu numbers observed over %d steps\n",
              ground_first ? "first" : "last", 2 * half_width, contacts, snapshot.size(), expected.size(), steps);

  CHECK(restore(world, snapshot) == BS_OK);  // the same world, gone on
  CHECK(same_bits(take(world), snapshot));
  CHECK(contact_count(world) == contacts);
  CHECK(same_bits(go_on(world), expected));
  CHECK(restore(world, snapshot) == BS_OK && restore(world, snapshot) == BS_OK);  // twice over
  CHECK(same_bits(go_on(world), expected));

  World fresh(settings());
  fill(fresh, ground_first, 5, half_width);
  CHECK(restore(fresh, snapshot) == BS_OK);
  CHECK(same_bits(take(fresh), snapshot));
  CHECK(same_bits(go_on(fresh), expected));

  World strayed(settings());
  fill(strayed, ground_first, 5, half_width);
  const double sideways[3] = {300, -200, 100};
  run(strayed, 37, 500, -1.5);
  CHECK(bs_world_set_gravity(strayed.handle, sideways) == BS_OK);
  run(strayed, 900, 700, 3);
  CHECK(restore(strayed, snapshot) == BS_OK);
  CHECK(same_bits(take(strayed), snapshot));
  CHECK(same_bits(go_on(strayed), expected));

  // Back and forth, as an optimiser would: every few steps to the start again.
  for (int round = 0; round < 10; ++round) {
    CHECK(restore(strayed, snapshot) == BS_OK);
    run(strayed, 100 * round, 7 * round, 1 + round);
  }
  CHECK(restore(strayed, snapshot) == BS_OK);
  CHECK(same_bits(go_on(strayed), expected));
}

void foreign_snapshots() {
  World world(settings());
  fill(world);
  CHECK(step_into_flight(world) > 0);
  const Numbers snapshot = take(world);
  std::string message;
  auto refused = [&](const Numbers &data) { return restore(world, data, &message) == BS_ERROR_SNAPSHOT && !message.empty(); };
  CHECK(bs_snapshot_restore(world.handle, snapshot.data(), 0, nullptr, 0) == BS_ERROR_SNAPSHOT);
  for (size_t length = 1; length < snapshot.size(); ++length) {
    // Exactly as long as it says, so that AddressSanitizer sees a read past the end.
    CHECK(refused(Numbers(snapshot.begin(), snapshot.begin() + static_cast<std::ptrdiff_t>(length))));
  }
  Numbers longer = snapshot;
  longer.push_back(0);
  CHECK(refused(longer));
  CHECK(same_bits(take(world), snapshot));

  // Every number spoiled in turn. Some values are as good as others (an angle of 1e300 is only bad physics), but nothing may crash,
  // what is refused must leave the world alone, and what is not finite must be refused.
  World victim(settings());
  fill(victim);
  CHECK(restore(victim, snapshot) == BS_OK);
  int taken = 0;
  for (size_t i = 0; i < snapshot.size(); ++i) {
    for (double value : {NOT_A_NUMBER, std::numeric_limits<double>::infinity(), 1e300, -1e10, -1.0, 0.5, 3.0, 4e9, 0.0}) {
      Numbers spoiled = snapshot;
      spoiled[i] = value;
      const int32_t code = restore(victim, spoiled, &message);
      const bool as_before = code == BS_OK || same_bits(take(victim), snapshot);
      if (!((code == BS_OK && std::isfinite(value)) || code == BS_ERROR_SNAPSHOT) || !as_before) CHECK(!"a spoiled snapshot");
      if (code == BS_OK) {
        ++taken;
        if (restore(victim, snapshot) != BS_OK) CHECK(!"a restore after a spoiled one");
      }
    }
  }
  std::printf("%zu numbers spoiled in 9 ways: %d of %zu accepted\n", snapshot.size(), taken, 9 * snapshot.size());
  CHECK(same_bits(take(victim), snapshot));
  // Neighbours swapped: well-formed integers in the wrong places.
  for (size_t i = 0; i + 1 < snapshot.size(); ++i) {
    Numbers swapped = snapshot;
    std::swap(swapped[i], swapped[i + 1]);
    const int32_t code = restore(victim, swapped);
    if (code != BS_OK && code != BS_ERROR_SNAPSHOT) CHECK(!"a snapshot with swapped numbers");
    if (code == BS_ERROR_SNAPSHOT && i % 16 == 0) CHECK(restore(victim, snapshot) == BS_OK);
  }
  CHECK(restore(victim, snapshot) == BS_OK);
  CHECK(same_bits(run(victim, BEFORE, 200), run(world, BEFORE, 200)));

  World heavier(settings()), other_order(settings()), empty(settings());
  fill(heavier, true, 5.5);
  fill(other_order, false);
  CHECK(bs_fixed_constraint_add(other_order.handle, 0, 1, nullptr, 0) == BS_OK);
  for (World *other : {&heavier, &other_order, &empty}) {
    const Numbers before = take(*other);
    CHECK(restore(*other, snapshot) == BS_ERROR_SNAPSHOT);
    CHECK(same_bits(take(*other), before));
    CHECK(restore(world, before) == BS_ERROR_SNAPSHOT);
  }
}

// With and without SSE2, of all short lengths.
void impulses() {
  const int most = 9;
  for (int count = 0; count <= most; ++count) {
    Numbers response(most), changes(most), body_changes(most);
    for (int i = 0; i < most; ++i) {
      response[static_cast<size_t>(i)] = std::sin(1.0 + i) / 3;
      changes[static_cast<size_t>(i)] = std::cos(2.0 + i) / 7;
      body_changes[static_cast<size_t>(i)] = std::exp(0.1 * i) / 9;
    }
    Numbers plain = changes, plain_body = body_changes;
    bs::add_impulse(response.data(), 0.1, changes.data(), body_changes.data(), count);
    bs::add_impulse_plain(response.data(), 0.1, plain.data(), plain_body.data(), count);
    CHECK(same_bits(changes, plain));
    CHECK(same_bits(body_changes, plain_body));
  }
}

void threads() {
  auto simulate = [](Numbers &out) {
    World world(settings());
    fill(world);
    out = run(world, 0, 600);
    const Numbers snapshot = take(world);
    run(world, 0, 50);
    if (restore(world, snapshot) != BS_OK) out.clear();
    const Numbers rest = run(world, 600, 600);
    out.insert(out.end(), rest.begin(), rest.end());
  };
  Numbers alone, together[4];
  simulate(alone);
  std::vector<std::thread> running;
  for (Numbers &out : together) running.emplace_back(simulate, std::ref(out));
  for (std::thread &thread : running) thread.join();
  for (const Numbers &out : together) CHECK(same_bits(out, alone));
}

}  // namespace

bs_tree_body tree_body(double mass, int parent, int joint) {
  bs_tree_body body{};
  body.mass = mass;
  body.orientation[3] = body.inertial_orientation[3] = body.box_orientation[3] = 1;
  body.position[0] = 1.5;
  body.inertial_position[0] = 0.5;
  for (double &half : body.half_extents) half = 0.5;
  body.axis[1] = 1;
  body.friction = 0.5;
  body.collision_margin = 0.001;
  body.parent = parent;
  body.joint = joint;
  body.has_box = 1;
  return body;
}

// A tree with a fixed joint and a link without a box falls on a floor, and goes on from what was saved.
void trees() {
  World world(settings());
  std::vector<bs_tree_body> bodies = {tree_body(1, -1, 0), tree_body(1, -1, 0), tree_body(2, 0, BS_JOINT_FIXED), tree_body(1, 0, 0)};
  bodies[0].position[2] = 0.6;
  bodies[3].has_box = 0;
  bs_tree_body floor = tree_body(0, -1, 0);
  floor.half_extents[0] = floor.half_extents[1] = 100;
  floor.position[2] = -0.5;
  floor.inertial_position[0] = 0;
  int32_t tree = -1, ground = -1;
  CHECK(bs_tree_add(world.handle, bodies.data(), 4, 1, &tree, nullptr, 0) == BS_OK && tree == 0);
  CHECK(bs_tree_add(world.handle, &floor, 1, 1, &ground, nullptr, 0) == BS_OK && ground == 1);
  bodies[2].parent = 2;
  CHECK(bs_tree_add(world.handle, bodies.data(), 4, 1, &ground, nullptr, 0) == BS_ERROR_ARGUMENT);
  const double frictions[3] = {0.4, 0.1, -1}, identity[4] = {0, 0, 0, 1}, zero[3] = {0, 0, 0};
  CHECK(bs_collider_frictions_set(world.handle, tree, 2, frictions) == BS_OK);
  CHECK(bs_collider_frictions_set(world.handle, tree, 3, frictions) == BS_ERROR_ARGUMENT);
  CHECK(bs_anchor_add(world.handle, tree, zero, identity, zero, identity, 500, nullptr, 0) == BS_OK);
  CHECK(bs_motor_set(world.handle, tree, 0, 0, 1, 0) == BS_OK && bs_motor_set(world.handle, tree, 3, 0, 1, 0) == BS_ERROR_ARGUMENT);
  const int32_t links[2] = {0, 1};
  const double torques[2] = {3, 5};
  auto steps = [&] {
    for (int i = 0; i < 200; ++i) {
      CHECK(bs_joint_torques_add(world.handle, tree, links, torques, 2) == BS_OK);
      CHECK(bs_world_step(world.handle, STEP, nullptr, 0) == BS_OK);
    }
    Numbers read(60);
    CHECK(bs_link_readings(world.handle, tree, 1, read.data(), 60) == BS_OK);
    return read;
  };
  steps();
  int32_t size = 0;
  CHECK(bs_resume_size(world.handle, &size) == BS_OK);
  Numbers saved(static_cast<size_t>(size));
  CHECK(bs_resume_take(world.handle, saved.data(), size, nullptr, 0) == BS_OK);
  CHECK(bs_resume_from(world.handle, saved.data(), size, nullptr, 0) == BS_OK);
  const Numbers once = steps();
  CHECK(bs_resume_from(world.handle, saved.data(), size, nullptr, 0) == BS_OK);
  CHECK(same_bits(once, steps()));
  CHECK(bs_resume_from(world.handle, saved.data(), size - 1, nullptr, 0) == BS_ERROR_SNAPSHOT);
}

int main() {
  identity();
  trees();
  misuse();
  reading_and_writing();
  beyond_plain_boxes();
  continuation(true, 500, 3000);
  continuation(false, 500, 1500);
  continuation(true, 1e6, 1500);  // so wide that Bullet stops updating its box and moves it to the tree of fixed objects
  foreign_snapshots();
  impulses();
  threads();
  CHECK(random_trees(10000) == 0);
  std::printf("%d passed, %d failed\n", passed.load(), failed.load());
  return failed == 0 ? 0 : 1;
}
