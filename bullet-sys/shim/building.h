// What both ways of building a multibody share: chains of boxes (multibody.cpp) and trees in frames (tree.cpp).
#ifndef BULLET_SHIM_BUILDING_H
#define BULLET_SHIM_BUILDING_H

#include <memory>

#include "internal.h"

namespace bs {

inline std::unique_ptr<btBoxShape> box(const double *half_extents, double margin) {
  for (int i = 0; i < 3; ++i) require(half_extents[i] > 0, "a half extent must be positive");
  auto shape = std::make_unique<btBoxShape>(vector(half_extents));
  shape->setMargin(margin);
  return shape;
}

// Makes the collider of `link` (-1: base), adds it to the world at `transform` and lists it in `body`.
inline btMultiBodyLinkCollider &add_collider(bs_world &world, Body &body, int link, btCollisionShape &shape, const btTransform &transform,
                                             bool is_static) {
  body.colliders.push_back(std::make_unique<btMultiBodyLinkCollider>(body.multibody.get(), link));
  btMultiBodyLinkCollider &collider = *body.colliders.back();
  collider.setCollisionShape(&shape);
  collider.setWorldTransform(transform);
  const int group = is_static ? int(btBroadphaseProxy::StaticFilter) : int(btBroadphaseProxy::DefaultFilter);
  const int mask = is_static ? int(btBroadphaseProxy::AllFilter ^ btBroadphaseProxy::StaticFilter) : int(btBroadphaseProxy::AllFilter);
  world.dynamics.addCollisionObject(&collider, group, mask);
  if (link < 0) {
    body.multibody->setBaseCollider(&collider);
  } else {
    body.multibody->getLink(link).m_collider = &collider;
  }
  return collider;
}

// Last part of building: place the base, spread the transforms to the links and colliders, hand over to the world.
inline void finish(bs_world &world, Body &body, const btTransform &base) {
  btMultiBody &multibody = *body.multibody;
  multibody.setHasSelfCollision(false);
  multibody.finalizeMultiDof();
  multibody.setBaseWorldTransform(base);
  btAlignedObjectArray<btQuaternion> scratch_rotations;
  btAlignedObjectArray<btVector3> scratch_origins;
  multibody.forwardKinematics(scratch_rotations, scratch_origins);
  multibody.updateCollisionObjectWorldTransforms(scratch_rotations, scratch_origins);
  body.move_colliders();
  world.dynamics.addMultiBody(&multibody);
}

// Takes a half-built body out of the world again when building fails on the way.
class Building {
 public:
  explicit Building(bs_world &world) : world_(world) { world.bodies.emplace_back(); }
  ~Building() {
    if (done_) return;
    Body &body = world_.bodies.back();
    for (auto &motor : body.motors) {
      if (motor) world_.dynamics.removeMultiBodyConstraint(motor.get());
    }
    if (body.multibody) world_.dynamics.removeMultiBody(body.multibody.get());
    for (auto &collider : body.colliders) world_.dynamics.removeCollisionObject(collider.get());
    world_.bodies.pop_back();
  }
  Body &body() { return world_.bodies.back(); }
  int32_t commit() {
    done_ = true;
    return static_cast<int32_t>(world_.bodies.size()) - 1;
  }

 private:
  bs_world &world_;
  bool done_ = false;
};

}  // namespace bs

#endif
