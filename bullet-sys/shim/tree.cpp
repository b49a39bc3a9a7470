// Trees in frames: what PyBullet makes of a list of bodies, by the same operations on transforms in the same order.
#include <cmath>

#include "building.h"

namespace {

using bs::Body;
using bs::Building;
using bs::require;

btQuaternion quaternion(const double *q) {
  for (int i = 0; i < 4; ++i) require(std::isfinite(q[i]), "a quaternion must be finite");
  const btQuaternion out(q[0], q[1], q[2], q[3]);
  require(out.length2() > 1e-12 && std::isfinite(out.length2()), "a quaternion must not be zero");
  return out;
}

btVector3 place(const double *v) {
  for (int i = 0; i < 3; ++i) require(std::isfinite(v[i]), "a position must be finite");
  return bs::vector(v);
}

btTransform frame(const double *position, const double *orientation) {
  btTransform transform;
  transform.setOrigin(place(position));
  transform.setRotation(quaternion(orientation));
  return transform;
}

void check(const bs_tree_body &body) {
  require(body.mass >= 0 && std::isfinite(body.mass), "a mass must not be negative, and finite");
  require(body.friction >= 0, "a friction coefficient must not be negative");
  require(body.collision_margin > 0, "a collision margin must be positive");
  require(body.compound_margin >= 0, "a collision margin must not be negative");
  require(body.joint == BS_JOINT_REVOLUTE || body.joint == BS_JOINT_FIXED, "no joint of that kind");
}

// The collision shape of a body: its box alone where this stands in the inertial frame, else in a compound; an empty one without a box.
btCollisionShape &shape_of(Body &body, const bs_tree_body &from, const btTransform &inertial) {
  btTransform in_inertial = inertial.inverse();
  btCollisionShape *child = nullptr;
  if (from.has_box != 0) {
    body.shapes.push_back(bs::box(from.half_extents, from.collision_margin));
    child = body.shapes.back().get();
    in_inertial = in_inertial * frame(from.box_position, from.box_orientation);
    if (in_inertial == btTransform::getIdentity()) return *child;
  }
  auto compound = std::make_unique<btCompoundShape>();
  if (child != nullptr) compound->addChildShape(in_inertial, child);
  compound->setMargin(from.compound_margin);
  body.shapes.push_back(std::move(compound));
  return *body.shapes.back();
}

btVector3 inertia_of(const btCollisionShape &shape, double mass) {
  btVector3 inertia(0, 0, 0);
  if (mass != 0) shape.calculateLocalInertia(mass, inertia);
  return inertia;
}

// Whether PyBullet takes a link of a fixed base for static, and leaves out its contacts with others that are: where fixed joints lead back to
// the base. It does not look at the joint of link 0 on the way, so that what is fixed to that link counts, too.
bool is_static(const btMultiBody &body, int link) {
  do {
    if (link >= 0 && body.getLink(link).m_jointType != btMultibodyLink::eFixed) return false;
    link = link >= 0 ? body.getParent(link) : -1;
  } while (link > 0);
  return true;
}

void add_motors(bs_world &world, Body &body, double impulse) {
  btMultiBody &multibody = *body.multibody;
  for (int i = 0; i < multibody.getNumLinks(); ++i) {
    body.motors.emplace_back();
    if (multibody.getLink(i).m_jointType != btMultibodyLink::eRevolute) continue;
    auto motor = std::make_unique<btMultiBodyJointMotor>(&multibody, i, btScalar(0), impulse);
    motor->setPositionTarget(0, 0);
    motor->setVelocityTarget(0, 1);
    motor->finalizeMultiDof();
    world.dynamics.addMultiBodyConstraint(motor.get());
    body.motors.back() = std::move(motor);
  }
}

}  // namespace

void bs::Body::damp_joints() {
  if (!has_damping) return;
  for (int i = 0; i < multibody->getNumLinks(); ++i) {
    const btMultibodyLink &link = multibody->getLink(i);
    if (link.m_dofCount > 0) multibody->addJointTorque(i, -link.m_jointDamping * multibody->getJointVel(i));
  }
}

extern "C" {

int32_t bs_tree_add(bs_world *world, const bs_tree_body *bodies, int32_t count, double motor_impulse, int32_t *body_index, char *error,
                    int32_t error_length) {
  return bs::guarded(error, error_length, [&] {
    require(world != nullptr && bodies != nullptr && body_index != nullptr, "null pointer");
    require(count > 0, "a tree needs a base");
    require(motor_impulse >= 0 && std::isfinite(motor_impulse), "an impulse must not be negative, and finite");
    for (int32_t i = 0; i < count; ++i) {
      check(bodies[i]);
      require(i == 0 || (bodies[i].parent >= -1 && bodies[i].parent < i - 1), "a link's parent must stand before it");
    }

    Building building(*world);
    Body &body = building.body();
    std::vector<btTransform> in_world, inertial_frames;
    for (int32_t i = 0; i < count; ++i) {
      const bs_tree_body &from = bodies[i];
      const int link = i - 1;
      const size_t parent = i == 0 ? 0 : static_cast<size_t>(from.parent + 1);
      const btTransform here = frame(from.position, from.orientation), inertial = frame(from.inertial_position, from.inertial_orientation);
      in_world.push_back(i == 0 ? here : in_world[parent] * here);
      inertial_frames.push_back(inertial);
      btCollisionShape &shape = shape_of(body, from, inertial);
      const btVector3 inertia = inertia_of(shape, from.mass);
      if (i == 0) {
        body.multibody = std::make_unique<btMultiBody>(count - 1, from.mass, inertia, from.mass == 0, false);
      } else {
        const btTransform from_parent = inertial_frames[parent].inverse() * here, to_frame = inertial.inverse();
        const btQuaternion rotation = to_frame.getRotation() * from_parent.inverse().getRotation();
        if (from.joint == BS_JOINT_FIXED) {
          body.multibody->setupFixed(link, from.mass, inertia, from.parent, rotation, from_parent.getOrigin(), -to_frame.getOrigin());
        } else {
          const btVector3 axis = place(from.axis);
          require(axis.length2() > 1e-12 && std::isfinite(axis.length2()), "a hinge axis must not be zero");
          body.multibody->setupRevolute(link, from.mass, inertia, from.parent, rotation, quatRotate(to_frame.getRotation(), axis),
                                        from_parent.getOrigin(), -to_frame.getOrigin(), true);
        }
        body.inertial_frames.push_back(inertial);
      }
      btCollisionObject &collider = bs::add_collider(*world, body, link, shape, in_world.back(), i == 0 && from.mass == 0);
      collider.setFriction(from.friction);
      if (bodies[0].mass == 0 && is_static(*body.multibody, link)) collider.setCollisionFlags(btCollisionObject::CF_STATIC_OBJECT);
      body.frictions.push_back(from.friction);
      body.com_to_box.push_back(btVector3(0, 0, 0));
    }
    bs::finish(*world, body, in_world[0] * inertial_frames[0]);
    add_motors(*world, body, motor_impulse);
    *body_index = building.commit();
  });
}

int32_t bs_anchor_add(bs_world *world, int32_t body, const double *pivot, const double *frame_in_base, const double *world_pivot,
                      const double *world_frame, double max_impulse, char *error, int32_t error_length) {
  return bs::guarded(error, error_length, [&] {
    require(world != nullptr && pivot != nullptr && frame_in_base != nullptr && world_pivot != nullptr && world_frame != nullptr,
            "null pointer");
    require(max_impulse > 0, "the largest impulse must be positive");
    auto constraint = std::make_unique<bs::FixedConstraint>(&world->multibody(body), place(pivot), btMatrix3x3(quaternion(frame_in_base)),
                                                            place(world_pivot), btMatrix3x3(quaternion(world_frame)));
    constraint->setMaxAppliedImpulse(max_impulse);
    world->constraints.push_back(std::move(constraint));
    world->dynamics.addMultiBodyConstraint(world->constraints.back().get());
  });
}

int32_t bs_motor_set(bs_world *world, int32_t body, int32_t link, double rate, double gain, double max_impulse) {
  return bs::guarded(nullptr, 0, [&] {
    require(world != nullptr, "null pointer");
    require(std::isfinite(rate) && std::isfinite(gain) && max_impulse >= 0, "a motor's rate and gain must be finite, its impulse not negative");
    const auto &motors = world->body(body).motors;
    require(link >= 0 && static_cast<size_t>(link) < motors.size(), "no link of that index");
    btMultiBodyJointMotor *motor = motors[static_cast<size_t>(link)].get();
    if (motor == nullptr) return;
    motor->setVelocityTarget(rate, gain);
    motor->setPositionTarget(0, 0);
    motor->setRhsClamp(SIMD_INFINITY);
    motor->setMaxAppliedImpulse(max_impulse);
  });
}

int32_t bs_joint_torques_add(bs_world *world, int32_t body, const int32_t *links, const double *torques, int32_t length) {
  return bs::guarded(nullptr, 0, [&] {
    require(world != nullptr && (length == 0 || (links != nullptr && torques != nullptr)), "null pointer");
    btMultiBody &multibody = world->multibody(body);
    for (int i = 0; i < length; ++i) require(links[i] >= 0 && links[i] < multibody.getNumLinks(), "no link of that index");
    for (int i = 0; i < length; ++i) {
      if (multibody.getLink(links[i]).m_dofCount > 0) multibody.addJointTorque(links[i], torques[i]);
    }
  });
}

int32_t bs_collider_frictions_set(bs_world *world, int32_t body, int32_t link, const double *frictions) {
  return bs::guarded(nullptr, 0, [&] {
    require(world != nullptr && frictions != nullptr, "null pointer");
    const auto &colliders = world->body(body).colliders;
    require(link >= -1 && static_cast<size_t>(link + 1) < colliders.size(), "no link of that index");
    btMultiBodyLinkCollider &collider = *colliders[static_cast<size_t>(link + 1)];
    if (frictions[0] >= 0) collider.setFriction(frictions[0]);
    if (frictions[1] >= 0) collider.setSpinningFriction(frictions[1]);
    if (frictions[2] >= 0) collider.setRollingFriction(frictions[2]);
  });
}

int32_t bs_dampings_set(bs_world *world, int32_t body, const double *dampings) {
  return bs::guarded(nullptr, 0, [&] {
    require(world != nullptr && dampings != nullptr, "null pointer");
    btMultiBody &multibody = world->multibody(body);
    if (dampings[0] >= 0) multibody.setLinearDamping(dampings[0]);
    if (dampings[1] >= 0) multibody.setAngularDamping(dampings[1]);
  });
}

int32_t bs_joint_damping_set(bs_world *world, int32_t body, int32_t link, double damping) {
  return bs::guarded(nullptr, 0, [&] {
    require(world != nullptr, "null pointer");
    btMultiBody &multibody = world->multibody(body);
    require(link >= 0 && link < multibody.getNumLinks(), "no link of that index");
    require(damping >= 0 && std::isfinite(damping), "a damping must not be negative, and finite");
    multibody.getLink(link).m_jointDamping = damping;
    world->bodies[static_cast<size_t>(body)].has_damping |= damping > 0;
  });
}

}  // extern "C"
