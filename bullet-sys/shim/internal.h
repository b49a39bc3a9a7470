// What the shim's parts share: the world behind the handle, and the wrapper that keeps C++ exceptions inside.
#ifndef BULLET_SHIM_INTERNAL_H
#define BULLET_SHIM_INTERNAL_H

#include <cstdio>
#include <memory>
#include <new>
#include <stdexcept>
#include <vector>

#include "BulletCollision/CollisionDispatch/btDefaultCollisionConfiguration.h"
#include "BulletCollision/CollisionDispatch/btCollisionDispatcher.h"
#include "BulletCollision/BroadphaseCollision/btDbvtBroadphase.h"
#include "BulletCollision/CollisionShapes/btBoxShape.h"
#include "BulletCollision/CollisionShapes/btCompoundShape.h"
#include "BulletDynamics/Featherstone/btMultiBody.h"
#include "BulletDynamics/Featherstone/btMultiBodyDynamicsWorld.h"
#include "BulletDynamics/Featherstone/btMultiBodyJointMotor.h"
#include "BulletDynamics/Featherstone/btMultiBodyLinkCollider.h"

#include "bullet_shim.h"
#include "fixed.h"
#include "solver.h"

static_assert(sizeof(btScalar) == sizeof(double), "the shim needs Bullet's double-precision headers: define BT_USE_DOUBLE_PRECISION");
static_assert(sizeof(btVector3) == 4 * sizeof(double), "btVector3 is four doubles in a double-precision build");
static_assert(BT_BULLET_VERSION == 324, "the shim is written for Bullet 3.24");

namespace bs {

// A refusal with the code to return.
struct Refusal : std::runtime_error {
  Refusal(int32_t code_, const char *message) : std::runtime_error(message), code(code_) {}
  int32_t code;
};

inline void require(bool condition, const char *message) {
  if (!condition) throw Refusal(BS_ERROR_ARGUMENT, message);
}

inline void report(char *error, int32_t error_length, const char *message) {
  if (error != nullptr && error_length > 0) std::snprintf(error, static_cast<size_t>(error_length), "%s", message);
}

// Runs `body` and turns whatever it throws into a code and a message. Every function of the header that can fail passes here.
template <class Body>
int32_t guarded(char *error, int32_t error_length, Body &&body) noexcept {
  try {
    body();
    return BS_OK;
  } catch (const Refusal &refusal) {
    report(error, error_length, refusal.what());
    return refusal.code;
  } catch (const std::bad_alloc &) {
    report(error, error_length, "out of memory");
    return BS_ERROR_MEMORY;
  } catch (const std::exception &exception) {
    report(error, error_length, exception.what());
    return BS_ERROR_INTERNAL;
  } catch (...) {
    report(error, error_length, "unknown C++ exception");
    return BS_ERROR_INTERNAL;
  }
}

// Bullet's dispatcher, with its list of manifolds open to the snapshot, which must restore the list's order.
struct Dispatcher : btCollisionDispatcher {
  using btCollisionDispatcher::btCollisionDispatcher;
  btAlignedObjectArray<btPersistentManifold *> &manifolds() { return m_manifoldsPtr; }
};

struct Body {
  // Members are destroyed in reverse: colliders before the multibody, that before the shapes.
  std::vector<std::unique_ptr<btCollisionShape>> shapes;
  std::unique_ptr<btMultiBody> multibody;
  std::vector<std::unique_ptr<btMultiBodyLinkCollider>> colliders;
  // Of the links of a tree; none on a fixed joint, none at all in a chain.
  std::vector<std::unique_ptr<btMultiBodyJointMotor>> motors;
  // Centre of mass and principal axes of the links of a tree, in each link's frame.
  std::vector<btTransform> inertial_frames;
  // What the body was built with, of the base first.
  std::vector<double> frictions;
  std::vector<btVector3> com_to_box;
  bool has_offsets = false;  // whether any of com_to_box is not zero
  bool has_damping = false;  // whether a joint has had a damping

  // Puts the colliders where the boxes are; Bullet puts them at the centres of mass.
  void move_colliders();
  // Adds the torques of joint damping, which Bullet leaves to the caller, to those for the coming step.
  void damp_joints();
};

inline btVector3 vector(const double *v) { return btVector3(v[0], v[1], v[2]); }
inline void store(double *out, const btVector3 &v) {
  out[0] = v.x();
  out[1] = v.y();
  out[2] = v.z();
}

}  // namespace bs

struct bs_world {
  explicit bs_world(const bs_settings &settings);
  ~bs_world();
  bs_world(const bs_world &) = delete;
  bs_world &operator=(const bs_world &) = delete;

  const bs::Body &body(int32_t index) const {
    bs::require(index >= 0 && static_cast<size_t>(index) < bodies.size(), "no multibody of that index");
    return bodies[static_cast<size_t>(index)];
  }
  btMultiBody &multibody(int32_t index) const { return *body(index).multibody; }

  // Destroyed in reverse: the dynamics world first, then what it refers to.
  btDefaultCollisionConfiguration configuration;
  bs::Dispatcher dispatcher;
  btHashedOverlappingPairCache pair_cache;
  btDbvtBroadphase broadphase;
  bs::Solver solver;
  btMultiBodyDynamicsWorld dynamics;
  std::vector<bs::Body> bodies;
  std::vector<std::unique_ptr<bs::FixedConstraint>> constraints;
  // Scratch of the velocity read-out: grows with the largest body, then stays.
  std::vector<btVector3> scratch_linear, scratch_angular;
};

#endif
