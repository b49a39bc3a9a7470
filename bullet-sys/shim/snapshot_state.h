// What a snapshot holds, and how it becomes doubles: one visitor for both ways, so that writing and reading cannot drift apart.
#ifndef BULLET_SHIM_SNAPSHOT_STATE_H
#define BULLET_SHIM_SNAPSHOT_STATE_H

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>

#include "internal.h"

namespace bs {
namespace snapshot {

constexpr double MAGIC = 0x4253534e41;  // "BSSNA"
constexpr double FORMAT = 2;

struct Joint {
  double angle = 0, rate = 0, torque = 0;
  btVector3 applied_force{0, 0, 0}, applied_torque{0, 0, 0};
  btQuaternion rotation{0, 0, 0, 1};                   // m_cachedRotParentToThis
  btVector3 offset{0, 0, 0};                           // m_cachedRVector
  btTransform transform = btTransform::getIdentity();  // m_cachedWorldTransform, one step behind
};
struct Body {
  btVector3 position{0, 0, 0}, velocity{0, 0, 0}, omega{0, 0, 0};
  btVector3 applied_force{0, 0, 0}, applied_torque{0, 0, 0};
  btQuaternion rotation{0, 0, 0, 1};  // world to base, as stored
  std::vector<Joint> joints;
};
struct Object {
  btTransform transform = btTransform::getIdentity(), interpolation = btTransform::getIdentity();
  int activation = ACTIVE_TAG;
  double deactivation_time = 0;
  btVector3 minima{0, 0, 0}, maxima{0, 0, 0};  // of the broadphase proxy
};
// Node of a broadphase tree. Where it lies in memory does not matter: the tree's balancing compares addresses, but only to swap
// the memory of a parent and a child, never to change the tree's shape.
struct Node {
  int object = -1;  // -1: inner node
  btVector3 minima{0, 0, 0}, maxima{0, 0, 0};
};
struct Tree {
  unsigned path = 0;        // m_opath
  std::vector<Node> nodes;  // in preorder
};
struct Pair {
  int first = 0, second = 0, has_algorithm = 0;  // indices of collision objects
};
struct Manifold {
  int first = 0, second = 0;
  std::vector<btManifoldPoint> points;
};
struct State {
  btVector3 gravity{0, 0, 0};
  std::vector<Body> bodies;
  std::vector<Object> objects;
  std::vector<std::vector<double>> impulses;  // of each constraint's rows
  int stage = 0, fixed_left = 0, new_pairs = 0, parse_id = 0, cleanup_index = 0, needs_cleanup = 0;
  unsigned update_calls = 0, updates_done = 0;
  double updates_ratio = 0;
  std::array<std::vector<int>, btDbvtBroadphase::STAGECOUNT + 1> stages;  // collision objects in the order of each list
  std::array<Tree, 2> trees;
  std::vector<Pair> pairs;
  std::vector<Manifold> manifolds;
};

inline void accept(bool condition, const char *message) {
  if (!condition) throw Refusal(BS_ERROR_SNAPSHOT, message);
}

// Doubles going out or coming in, in one order for both. Nothing that comes in is trusted: integers are checked before they are
// converted, counts before they are allocated for.
class Fields {
 public:
  Fields() = default;
  Fields(const double *data, size_t length) : next_(data), end_(data + length), reading_(true) {}
  const std::vector<double> &written() const { return out_; }
  bool at_end() const { return next_ == end_; }

  void real(double &value) {
    if (!reading_) return out_.push_back(value);
    accept(next_ != end_, "the snapshot is truncated");
    accept(std::isfinite(*next_), "the snapshot holds a value that is not finite");
    value = *next_++;
  }
  template <class Integer>
  void integer(Integer &value, Integer low = std::numeric_limits<Integer>::min(),
               Integer high = std::numeric_limits<Integer>::max()) {
    double number = static_cast<double>(value);
    real(number);
    if (!reading_) return;
    accept(number >= static_cast<double>(low) && number <= static_cast<double>(high) && number == std::floor(number),
           "the snapshot holds an integer or index out of range");
    value = static_cast<Integer>(number);
  }
  // A value that a snapshot of this world must hold.
  void same(double expected, const char *message) {
    double value = expected;
    real(value);
    accept(value == expected, message);
  }
  void operator()(btVector3 &v) {
    for (int i = 0; i < 3; ++i) real(v[i]);
  }
  void operator()(btQuaternion &q) {
    for (int i = 0; i < 4; ++i) real(q[i]);
  }
  void operator()(btTransform &t) {
    for (int row = 0; row < 3; ++row) (*this)(t.getBasis()[row]);
    (*this)(t.getOrigin());
  }
  template <class Item>
  void count(std::vector<Item> &items, size_t high) {
    int number = static_cast<int>(items.size());
    const size_t left = reading_ ? static_cast<size_t>(end_ - next_) : high;
    integer(number, 0, static_cast<int>(std::min(high, left)));
    items.resize(static_cast<size_t>(number));
  }

 private:
  std::vector<double> out_;
  const double *next_ = nullptr, *end_ = nullptr;
  bool reading_ = false;
};

inline btDbvtProxy &proxy_of(btCollisionObject &object) { return *static_cast<btDbvtProxy *>(object.getBroadphaseHandle()); }
inline int index_of(const btBroadphaseProxy &proxy) {
  return static_cast<btCollisionObject *>(proxy.m_clientObject)->getWorldArrayIndex();
}

// A number that differs between worlds whose bodies differ, 52 bits of FNV-1a over masses, frames, boxes, frictions
// (those they were built with), restitutions and constraints. The solver's settings are not in it: a snapshot may be continued under others.
inline double fingerprint(const bs_world &world) {
  uint64_t hash = 14695981039346656037u;
  auto mix = [&hash](double value) {
    uint64_t bits;
    std::memcpy(&bits, &value, sizeof bits);
    for (int i = 0; i < 8; ++i) hash = (hash ^ ((bits >> (8 * i)) & 255)) * 1099511628211u;
  };
  auto mix3 = [&mix](const btVector3 &v) { mix(v.x()), mix(v.y()), mix(v.z()); };
  for (const auto &body : world.bodies) {
    const btMultiBody &multibody = *body.multibody;
    mix(multibody.getBaseMass());
    mix3(multibody.getBaseInertia());
    for (int i = 0; i < multibody.getNumLinks(); ++i) {
      const btMultibodyLink &link = multibody.getLink(i);
      mix(link.m_mass), mix(link.m_parent);
      mix3(link.m_inertiaLocal), mix3(link.m_dVector), mix3(link.m_eVector), mix3(link.getAxisTop(0));
    }
    for (const btVector3 &offset : body.com_to_box) mix3(offset);
    for (double friction : body.frictions) mix(friction);
    for (const auto &collider : body.colliders) {
      btVector3 minima, maxima;
      collider->getCollisionShape()->getAabb(btTransform::getIdentity(), minima, maxima);
      mix3(minima), mix3(maxima);
      mix(collider->getCollisionShape()->getMargin()), mix(collider->getRestitution());
    }
  }
  for (const auto &constraint : world.constraints) {
    mix(constraint->getMaxAppliedImpulse()), mix(constraint->compliance()), mix3(constraint->pivot());
    if (constraint->damping_time() != 0) mix(constraint->damping_time());
    if (constraint->hardening() != 0) mix(constraint->hardening());
    if (constraint->is_bent()) {
      mix(constraint->width());
      for (int i = 0; i < BS_CLAMP_POINTS; ++i) mix(constraint->bent_compliance(i));
    }
    if (constraint->shift_compliance() != 0) mix(constraint->shift_compliance()), mix(constraint->shift_damping_time());
  }
  return static_cast<double>(hash >> 12);
}

inline void visit(Fields &fields, btManifoldPoint &p) {
  for (btVector3 *v : {&p.m_localPointA, &p.m_localPointB, &p.m_positionWorldOnB, &p.m_positionWorldOnA, &p.m_normalWorldOnB,
                       &p.m_lateralFrictionDir1, &p.m_lateralFrictionDir2})
    fields(*v);
  for (double *r : {&p.m_distance1, &p.m_combinedFriction, &p.m_combinedRollingFriction, &p.m_combinedSpinningFriction,
                    &p.m_combinedRestitution, &p.m_appliedImpulse, &p.m_prevRHS, &p.m_appliedImpulseLateral1,
                    &p.m_appliedImpulseLateral2, &p.m_contactMotion1, &p.m_contactMotion2, &p.m_contactCFM, &p.m_contactERP,
                    &p.m_frictionCFM})
    fields.real(*r);
  for (int *i : {&p.m_partId0, &p.m_partId1, &p.m_index0, &p.m_index1, &p.m_contactPointFlags, &p.m_lifeTime}) fields.integer(*i);
}

// Every field of a State, with the make-up that it belongs to in front.
inline void visit(Fields &fields, const bs_world &world, State &state) {
  const btDbvtBroadphase &broadphase = world.broadphase;
  const int last = world.dynamics.getNumCollisionObjects() - 1;
  const size_t objects = static_cast<size_t>(last + 1);
  const int half = std::numeric_limits<int>::max() / 2;  // room for what Bullet adds to its counters before it takes a remainder
  fields.same(MAGIC, "these are not the numbers of a snapshot");
  fields.same(FORMAT, "the snapshot is of another format version");
  fields.same(static_cast<double>(world.bodies.size()), "the snapshot has another number of multibodies");
  fields.same(static_cast<double>(objects), "the snapshot has another number of collision objects");
  fields.same(static_cast<double>(world.constraints.size()), "the snapshot has another number of constraints");
  fields.same(fingerprint(world), "the snapshot is of bodies that are built differently");
  for (int value : {broadphase.m_fupdates, broadphase.m_dupdates, broadphase.m_cupdates, int(broadphase.m_deferedcollide),
                    broadphase.m_sets[0].m_lkhd, broadphase.m_sets[1].m_lkhd})
    fields.same(value, "the snapshot is of a broadphase that is set differently");

  fields(state.gravity);
  state.bodies.resize(world.bodies.size());
  for (size_t b = 0; b < state.bodies.size(); ++b) {
    Body &body = state.bodies[b];
    const int links = world.bodies[b].multibody->getNumLinks();
    fields.same(links, "the snapshot has another number of links");
    fields(body.position), fields(body.rotation), fields(body.velocity), fields(body.omega);
    fields(body.applied_force), fields(body.applied_torque);
    body.joints.resize(static_cast<size_t>(links));
    for (Joint &joint : body.joints) {
      fields.real(joint.angle), fields.real(joint.rate), fields.real(joint.torque);
      fields(joint.applied_force), fields(joint.applied_torque);
      fields(joint.rotation), fields(joint.offset), fields(joint.transform);
    }
  }
  state.objects.resize(objects);
  for (Object &object : state.objects) {
    fields(object.transform), fields(object.interpolation), fields(object.minima), fields(object.maxima);
    fields.integer(object.activation, ACTIVE_TAG, FIXED_BASE_MULTI_BODY);
    fields.real(object.deactivation_time);
  }
  state.impulses.resize(world.constraints.size());
  for (size_t c = 0; c < state.impulses.size(); ++c) {
    state.impulses[c].resize(static_cast<size_t>(world.constraints[c]->getNumRows()));
    for (double &impulse : state.impulses[c]) fields.real(impulse);
  }
  fields.integer(state.stage, 0, int(btDbvtBroadphase::STAGECOUNT) - 1);
  for (int *counter : {&state.fixed_left, &state.new_pairs, &state.cleanup_index}) fields.integer(*counter, 0, half);
  fields.integer(state.parse_id);
  fields.integer(state.needs_cleanup, 0, 1);
  fields.integer(state.update_calls), fields.integer(state.updates_done), fields.real(state.updates_ratio);
  for (auto &list : state.stages) {
    fields.count(list, objects);
    for (int &object : list) fields.integer(object, 0, last);
  }
  for (Tree &tree : state.trees) {
    fields.integer(tree.path);
    fields.count(tree.nodes, 2 * objects);
    for (Node &node : tree.nodes) {
      fields.integer(node.object, -1, last);
      fields(node.minima), fields(node.maxima);
    }
  }
  fields.count(state.pairs, objects * objects);
  for (Pair &pair : state.pairs) {
    fields.integer(pair.first, 0, last), fields.integer(pair.second, 0, last), fields.integer(pair.has_algorithm, 0, 1);
  }
  fields.count(state.manifolds, state.pairs.size());
  for (Manifold &manifold : state.manifolds) {
    fields.integer(manifold.first, 0, last), fields.integer(manifold.second, 0, last);
    fields.count(manifold.points, MANIFOLD_CACHE_SIZE);
    for (btManifoldPoint &point : manifold.points) visit(fields, point);
  }
}

}  // namespace snapshot
}  // namespace bs

#endif
