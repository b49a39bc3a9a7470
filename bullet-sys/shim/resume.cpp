// What PyBullet saves to a file and restores from it: the state of the bodies and the contact points. All else is made anew from them, so that
// a resumed world does not go on with the same bits, but with PyBullet's.
#include "BulletCollision/BroadphaseCollision/btCollisionAlgorithm.h"
#include "snapshot_state.h"

namespace {

using namespace bs::snapshot;

constexpr double RESUME = 0x425352534d;  // "BSRSM"

struct Motion {
  btVector3 position{0, 0, 0}, velocity{0, 0, 0}, omega{0, 0, 0};
  btQuaternion rotation{0, 0, 0, 1};  // base to world
  std::vector<double> angles, rates;  // of the links; 0 on fixed joints
};
struct Resumed {
  std::vector<Motion> bodies;
  std::vector<Manifold> manifolds;
};

bool is_hinge(const btMultiBody &body, int link) { return body.getLink(link).m_dofCount > 0; }

Resumed capture(const bs_world &world) {
  Resumed state;
  for (const auto &from : world.bodies) {
    const btMultiBody &multibody = *from.multibody;
    Motion motion;
    motion.position = multibody.getBasePos();
    motion.rotation = multibody.getWorldToBaseRot().inverse();
    motion.velocity = multibody.getBaseVel();
    motion.omega = multibody.getBaseOmega();
    for (int i = 0; i < multibody.getNumLinks(); ++i) {
      motion.angles.push_back(is_hinge(multibody, i) ? multibody.getJointPos(i) : 0);
      motion.rates.push_back(is_hinge(multibody, i) ? multibody.getJointVel(i) : 0);
    }
    state.bodies.push_back(motion);
  }
  bs::Dispatcher &dispatcher = const_cast<bs::Dispatcher &>(world.dispatcher);
  for (int m = 0; m < dispatcher.getNumManifolds(); ++m) {
    const btPersistentManifold &from = *dispatcher.manifolds()[m];
    Manifold manifold;
    manifold.first = from.getBody0()->getWorldArrayIndex();
    manifold.second = from.getBody1()->getWorldArrayIndex();
    for (int p = 0; p < from.getNumContacts(); ++p) manifold.points.push_back(from.getContactPoint(p));
    state.manifolds.push_back(std::move(manifold));
  }
  return state;
}

void visit(Fields &fields, const bs_world &world, Resumed &state) {
  const int objects = world.dynamics.getNumCollisionObjects();
  fields.same(RESUME, "these are not the numbers of a saved world");
  fields.same(static_cast<double>(world.bodies.size()), "the saved world has another number of bodies");
  fields.same(objects, "the saved world has another number of links");
  state.bodies.resize(world.bodies.size());
  for (size_t b = 0; b < state.bodies.size(); ++b) {
    Motion &motion = state.bodies[b];
    const int links = world.bodies[b].multibody->getNumLinks();
    fields.same(links, "the saved world has another number of links");
    fields(motion.position), fields(motion.rotation), fields(motion.velocity), fields(motion.omega);
    motion.angles.resize(static_cast<size_t>(links)), motion.rates.resize(static_cast<size_t>(links));
    for (double &angle : motion.angles) fields.real(angle);
    for (double &rate : motion.rates) fields.real(rate);
  }
  fields.count(state.manifolds, static_cast<size_t>(objects) * static_cast<size_t>(objects));
  for (Manifold &manifold : state.manifolds) {
    fields.integer(manifold.first, 0, objects - 1), fields.integer(manifold.second, 0, objects - 1);
    fields.count(manifold.points, MANIFOLD_CACHE_SIZE);
    for (btManifoldPoint &point : manifold.points) visit(fields, point);
  }
}

void apply(const Motion &from, btMultiBody &multibody) {
  multibody.setBasePos(from.position);
  multibody.setWorldToBaseRot(from.rotation.inverse());
  multibody.setBaseVel(from.velocity);
  multibody.setBaseOmega(from.omega);
  for (int i = 0; i < multibody.getNumLinks(); ++i) {
    if (!is_hinge(multibody, i)) continue;
    multibody.setJointPos(i, from.angles[static_cast<size_t>(i)]);
    multibody.setJointVel(i, from.rates[static_cast<size_t>(i)]);
  }
  btAlignedObjectArray<btQuaternion> scratch_rotations;
  btAlignedObjectArray<btVector3> scratch_origins;
  multibody.forwardKinematics(scratch_rotations, scratch_origins);
  multibody.updateCollisionObjectWorldTransforms(scratch_rotations, scratch_origins);
}

// Finds the pairs that touch now, and gives each its saved points, or none.
void apply_points(const std::vector<Manifold> &saved, bs_world &world) {
  world.dynamics.updateAabbs();
  world.dynamics.computeOverlappingPairs();
  world.dispatcher.dispatchAllCollisionPairs(&world.pair_cache, world.dynamics.getDispatchInfo(), &world.dispatcher);
  btBroadphasePairArray &pairs = world.pair_cache.getOverlappingPairArray();
  btManifoldArray found;
  for (int i = 0; i < pairs.size(); ++i) {
    if (pairs[i].m_algorithm == nullptr) continue;
    pairs[i].m_algorithm->getAllContactManifolds(found);
    for (int m = 0; m < found.size(); ++m) {
      btPersistentManifold &manifold = *found[m];
      const Manifold *match = nullptr;
      for (const Manifold &candidate : saved) {
        const bool same = manifold.getBody0()->getWorldArrayIndex() == candidate.first && manifold.getBody1()->getWorldArrayIndex() == candidate.second;
        if (same) match = &candidate;
      }
      manifold.setNumContacts(0);
      if (match == nullptr) continue;
      for (size_t p = 0; p < match->points.size(); ++p) manifold.getContactPoint(static_cast<int>(p)) = match->points[p];
      manifold.setNumContacts(static_cast<int>(match->points.size()));
    }
    found.resize(0);
  }
}

Fields fields_of(const bs_world *world) {
  Resumed state = capture(*world);
  Fields fields;
  visit(fields, *world, state);
  bs::require(fields.written().size() <= static_cast<size_t>(std::numeric_limits<int32_t>::max()), "the saved world is too long");
  return fields;
}

}  // namespace

extern "C" {

int32_t bs_resume_size(const bs_world *world, int32_t *size) {
  return bs::guarded(nullptr, 0, [&] {
    bs::require(world != nullptr && size != nullptr, "null pointer");
    *size = static_cast<int32_t>(fields_of(world).written().size());
  });
}

int32_t bs_resume_take(const bs_world *world, double *data, int32_t length, char *error, int32_t error_length) {
  return bs::guarded(error, error_length, [&] {
    bs::require(world != nullptr && data != nullptr, "null pointer");
    const Fields fields = fields_of(world);
    bs::require(length >= 0 && static_cast<size_t>(length) >= fields.written().size(), "the saved world does not fit into the array");
    std::copy(fields.written().begin(), fields.written().end(), data);
  });
}

int32_t bs_resume_from(bs_world *world, const double *data, int32_t length, char *error, int32_t error_length) {
  return bs::guarded(error, error_length, [&] {
    bs::require(world != nullptr && data != nullptr && length >= 0, "null pointer");
    Resumed state;
    Fields fields(data, static_cast<size_t>(length));
    visit(fields, *world, state);
    accept(fields.at_end(), "the saved world is longer than it should be");
    for (const Motion &motion : state.bodies) accept(motion.rotation.length2() > 1e-12, "the saved world has a quaternion of zero");
    for (size_t b = 0; b < state.bodies.size(); ++b) apply(state.bodies[b], *world->bodies[b].multibody);
    apply_points(state.manifolds, *world);
  });
}

}  // extern "C"
