// Multibodies: building them in the order that PyBullet uses (it decides the order of contacts and so the last bits), and
// reading and writing their state.
#include <cmath>

#include "BulletCollision/CollisionDispatch/btManifoldResult.h"
#include "building.h"

namespace {

using bs::Body;
using bs::Building;
using bs::add_collider;
using bs::box;
using bs::require;

bool is_finite(const double *v) { return std::isfinite(v[0]) && std::isfinite(v[1]) && std::isfinite(v[2]); }

btVector3 inertia_of(const btCollisionShape &shape, const bs_link &link) {
  btVector3 inertia = bs::vector(link.inertia);
  if (inertia.isZero()) shape.calculateLocalInertia(link.mass, inertia);
  return inertia;
}

btTransform at(const btVector3 &origin) {
  btTransform transform;
  transform.setIdentity();
  transform.setOrigin(origin);
  return transform;
}

// The body's last part, without damping.
void finish(bs_world &world, Body &body, const btVector3 &base_position) {
  bs::finish(world, body, at(base_position));
  body.multibody->setLinearDamping(0);
  body.multibody->setAngularDamping(0);
}

void check(const bs_link &link) {
  require(link.mass > 0, "a mass must be positive");
  const btVector3 inertia = bs::vector(link.inertia);
  require(is_finite(link.inertia), "moments of inertia must be finite");
  require(inertia.isZero() || (inertia.x() > 0 && inertia.y() > 0 && inertia.z() > 0), "moments of inertia must be positive, or all zero");
  require(is_finite(link.com_to_box), "an offset must be finite");
  require(link.restitution >= 0 && link.restitution <= 1, "a coefficient of restitution must be from 0 to 1");
  require(link.collision_margin > 0, "a collision margin must be positive");
  require(link.friction >= 0, "a friction coefficient must not be negative");
}

// Links that hang each on the one before it.
bool is_chain(const btMultiBody &body) {
  for (int i = 0; i < body.getNumLinks(); ++i) {
    if (body.getParent(i) != i - 1) return false;
  }
  return body.getNumLinks() > 0;
}

void require_positive(double value, const char *message) { require(value > 0 && std::isfinite(value), message); }

void require_damping_time(double value) { require(value >= 0 && std::isfinite(value), "a damping time must not be negative, and finite"); }

btMultiBody &chain_of(bs_world &world, int32_t body) {
  btMultiBody &multibody = world.multibody(body);
  require(is_chain(multibody), "a tie that gives needs a chain");
  return multibody;
}

// Ties the base of a chain so that it may turn about its y axis at `pivot`.
bs::FixedConstraint &add_tie(bs_world *world, int32_t body, const double *pivot, double compliance, double damping_time, double hardening,
                             double max_impulse) {
  require(world != nullptr && pivot != nullptr, "null pointer");
  require(max_impulse > 0, "the largest impulse must be positive");
  require_damping_time(damping_time);
  require(is_finite(pivot), "a pivot must be finite");
  btMultiBody &multibody = chain_of(*world, body);
  auto constraint = std::make_unique<bs::FixedConstraint>(&multibody, multibody.getBaseWorldTransform(), bs::vector(pivot), compliance,
                                                          damping_time, hardening);
  constraint->setMaxAppliedImpulse(max_impulse);
  world->constraints.push_back(std::move(constraint));
  world->dynamics.addMultiBodyConstraint(world->constraints.back().get());
  return *world->constraints.back();
}

}  // namespace

void bs::Body::move_colliders() {
  if (!has_offsets) return;
  for (size_t i = 0; i < colliders.size(); ++i) {
    btTransform transform = colliders[i]->getWorldTransform();
    transform.setOrigin(transform(com_to_box[i]));
    colliders[i]->setWorldTransform(transform);
    colliders[i]->setInterpolationWorldTransform(transform);
  }
}

extern "C" {

int32_t bs_multibody_add(bs_world *world, const bs_link *base, const bs_link *links, int32_t link_count,
                         const double *base_position, int32_t *body_index, char *error, int32_t error_length) {
  return bs::guarded(error, error_length, [&] {
    require(world != nullptr && base != nullptr && base_position != nullptr && body_index != nullptr, "null pointer");
    require(link_count == 0 || links != nullptr, "null pointer");
    require(link_count >= 0, "a negative number of links");
    check(*base);
    for (int32_t i = 0; i < link_count; ++i) {
      check(links[i]);
      require(links[i].parent >= -1 && links[i].parent < i, "a link's parent must stand before it");
      require(btFabs(bs::vector(links[i].axis).length2() - 1.0) < 1e-9, "a hinge axis must be of unit length");
    }

    Building building(*world);
    Body &body = building.body();
    body.shapes.push_back(box(base->half_extents, base->collision_margin));
    body.multibody = std::make_unique<btMultiBody>(link_count, base->mass, inertia_of(*body.shapes[0], *base), false, false);
    btMultiBody &multibody = *body.multibody;
    multibody.setBaseWorldTransform(btTransform::getIdentity());
    const btVector3 origin = bs::vector(base_position);
    add_collider(*world, body, -1, *body.shapes[0], at(origin), false);

    // Where every body's frame stands so far, in the zero configuration: the base's centre of mass, then the joints. Summed from
    // frame to frame, as PyBullet does: by way of the centres of mass the last bit differs, and with it which neighbours' boxes
    // touch at the start, the order of the pairs in the broadphase, and in the end the order of contacts.
    std::vector<btVector3> frames{origin};
    std::vector<btVector3> to_centre{btVector3(0, 0, 0)};
    for (int32_t i = 0; i < link_count; ++i) {
      const bs_link &link = links[i];
      body.shapes.push_back(box(link.half_extents, link.collision_margin));
      btCollisionShape &shape = *body.shapes.back();
      multibody.setupRevolute(i, link.mass, inertia_of(shape, link), link.parent, btQuaternion(0, 0, 0, 1), bs::vector(link.axis),
                              bs::vector(link.parent_com_to_joint), bs::vector(link.joint_to_com), true);
      const size_t parent = static_cast<size_t>(link.parent + 1);
      frames.push_back(frames[parent] + (to_centre[parent] + bs::vector(link.parent_com_to_joint)));
      to_centre.push_back(bs::vector(link.joint_to_com));
      add_collider(*world, body, i, shape, at(frames.back()), false);
    }
    for (int32_t i = -1; i < link_count; ++i) {
      const bs_link &link = i < 0 ? *base : links[i];
      body.com_to_box.push_back(bs::vector(link.com_to_box));
      body.has_offsets |= !body.com_to_box.back().isZero();
      body.frictions.push_back(link.friction);
    }
    finish(*world, body, origin);
    // Frictions after everything else, base first, as the reference sets them.
    for (size_t i = 0; i < body.colliders.size(); ++i) {
      body.colliders[i]->setFriction(body.frictions[i]);
      body.colliders[i]->setRestitution(i == 0 ? base->restitution : links[i - 1].restitution);
    }
    *body_index = building.commit();
  });
}

int32_t bs_ground_add(bs_world *world, const double *half_extents, double top, double friction, double restitution,
                      double collision_margin, int32_t *body_index, char *error, int32_t error_length) {
  return bs::guarded(error, error_length, [&] {
    require(world != nullptr && half_extents != nullptr && body_index != nullptr, "null pointer");
    require(collision_margin > 0, "a collision margin must be positive");
    require(friction >= 0, "a friction coefficient must not be negative");
    require(restitution >= 0 && restitution <= 1, "a coefficient of restitution must be from 0 to 1");
    Building building(*world);
    Body &body = building.body();
    body.shapes.push_back(box(half_extents, collision_margin));
    auto compound = std::make_unique<btCompoundShape>();
    btTransform child;
    child.setIdentity();
    child.setOrigin(btVector3(0, 0, -half_extents[2]));
    compound->addChildShape(child, body.shapes[0].get());
    compound->setMargin(collision_margin);
    btCompoundShape &shape = *compound;
    body.shapes.push_back(std::move(compound));
    body.multibody = std::make_unique<btMultiBody>(0, btScalar(0), btVector3(0, 0, 0), true, false);
    const btVector3 origin(0, 0, top);
    add_collider(*world, body, -1, shape, at(origin), true);
    finish(*world, body, origin);
    body.colliders[0]->setFriction(friction);
    body.colliders[0]->setRestitution(restitution);
    body.frictions.push_back(friction);
    *body_index = building.commit();
  });
}

int32_t bs_fixed_constraint_add(bs_world *world, int32_t body, double max_impulse, char *error, int32_t error_length) {
  return bs::guarded(error, error_length, [&] {
    require(world != nullptr, "null pointer");
    require(max_impulse > 0, "the largest impulse must be positive");
    btMultiBody &multibody = world->multibody(body);
    auto constraint = std::make_unique<bs::FixedConstraint>(&multibody, multibody.getBaseWorldTransform());
    constraint->setMaxAppliedImpulse(max_impulse);
    world->constraints.push_back(std::move(constraint));
    world->dynamics.addMultiBodyConstraint(world->constraints.back().get());
  });
}

int32_t bs_sprung_constraint_add(bs_world *world, int32_t body, const double *pivot, double compliance, double damping_time, double hardening,
                                 double max_impulse, char *error, int32_t error_length) {
  return bs::guarded(error, error_length, [&] {
    require_positive(compliance, "a compliance must be positive and finite");
    require(hardening >= 0 && std::isfinite(hardening), "a hardening must not be negative, and finite");
    add_tie(world, body, pivot, compliance, damping_time, hardening, max_impulse);
  });
}

int32_t bs_bent_constraint_add(bs_world *world, int32_t body, const double *pivot, double width, const double *compliances, double damping_time,
                               double max_impulse, char *error, int32_t error_length) {
  return bs::guarded(error, error_length, [&] {
    require(compliances != nullptr, "null pointer");
    require_positive(width, "a width must be positive and finite");
    for (int i = 0; i < BS_CLAMP_POINTS; ++i) require_positive(compliances[i], "a compliance must be positive and finite");
    add_tie(world, body, pivot, 0, damping_time, 0, max_impulse).bend(width, compliances);
  });
}

int32_t bs_constraint_shift_set(bs_world *world, int32_t body, double compliance, double damping_time, char *error, int32_t error_length) {
  return bs::guarded(error, error_length, [&] {
    require(world != nullptr, "null pointer");
    require_positive(compliance, "a compliance must be positive and finite");
    require_damping_time(damping_time);
    const btMultiBody &multibody = chain_of(*world, body);
    bool found = false;
    for (const auto &constraint : world->constraints) {
      if (constraint->getMultiBodyA() != &multibody) continue;
      constraint->set_shift(compliance, damping_time);
      found = true;
    }
    require(found, "the body is not tied");
  });
}

int32_t bs_joint_states(const bs_world *world, int32_t body, double *angles, double *rates, int32_t length) {
  return bs::guarded(nullptr, 0, [&] {
    require(world != nullptr && angles != nullptr && rates != nullptr, "null pointer");
    const btMultiBody &multibody = world->multibody(body);
    require(length == multibody.getNumLinks(), "one value per link");
    for (int i = 0; i < length; ++i) {
      angles[i] = multibody.getJointPos(i);
      rates[i] = multibody.getJointVel(i);
    }
  });
}

int32_t bs_joint_states_set(bs_world *world, int32_t body, const double *angles, const double *rates, int32_t length) {
  return bs::guarded(nullptr, 0, [&] {
    require(world != nullptr && angles != nullptr && rates != nullptr, "null pointer");
    btMultiBody &multibody = world->multibody(body);
    require(length == multibody.getNumLinks(), "one value per link");
    for (int i = 0; i < length; ++i) {
      multibody.setJointPos(i, angles[i]);
      multibody.setJointVel(i, rates[i]);
    }
  });
}

int32_t bs_joint_torques_set(bs_world *world, int32_t body, const double *torques, int32_t length) {
  return bs::guarded(nullptr, 0, [&] {
    require(world != nullptr && torques != nullptr, "null pointer");
    btMultiBody &multibody = world->multibody(body);
    require(length == multibody.getNumLinks(), "one value per link");
    for (int i = 0; i < length; ++i) multibody.getLink(i).m_jointTorque[0] = torques[i];
  });
}

int32_t bs_forces_add(bs_world *world, int32_t body, const double *forces, int32_t length) {
  return bs::guarded(nullptr, 0, [&] {
    require(world != nullptr && forces != nullptr, "null pointer");
    btMultiBody &multibody = world->multibody(body);
    require(length == 6 * (multibody.getNumLinks() + 1), "6 values per body");
    multibody.addBaseForce(bs::vector(forces));
    multibody.addBaseTorque(bs::vector(forces + 3));
    for (int i = 0; i < multibody.getNumLinks(); ++i) {
      multibody.addLinkForce(i, bs::vector(forces + 6 * i + 6));
      multibody.addLinkTorque(i, bs::vector(forces + 6 * i + 9));
    }
  });
}

int32_t bs_frictions_set(bs_world *world, int32_t body, const double *frictions, int32_t length) {
  return bs::guarded(nullptr, 0, [&] {
    require(world != nullptr && frictions != nullptr, "null pointer");
    const auto &colliders = world->body(body).colliders;
    require(length >= 0 && static_cast<size_t>(length) == colliders.size(), "one value per body");
    for (int i = 0; i < length; ++i) require(frictions[i] >= 0, "a friction coefficient must not be negative");
    for (int i = 0; i < length; ++i) colliders[static_cast<size_t>(i)]->setFriction(frictions[i]);
    // Points that the next step does not find anew keep what they have.
    for (int m = 0; m < world->dispatcher.getNumManifolds(); ++m) {
      btPersistentManifold &manifold = *world->dispatcher.manifolds()[m];
      const btScalar friction = btManifoldResult::calculateCombinedFriction(manifold.getBody0(), manifold.getBody1());
      for (int p = 0; p < manifold.getNumContacts(); ++p) manifold.getContactPoint(p).m_combinedFriction = friction;
    }
  });
}

int32_t bs_base_state(const bs_world *world, int32_t body, double *state, int32_t length) {
  return bs::guarded(nullptr, 0, [&] {
    require(world != nullptr && state != nullptr, "null pointer");
    require(length == 13, "a base state is 13 values");
    const btMultiBody &multibody = world->multibody(body);
    const btQuaternion rotation = multibody.getWorldToBaseRot().inverse();
    bs::store(state, multibody.getBasePos());
    for (int i = 0; i < 4; ++i) state[3 + i] = rotation[i];
    bs::store(state + 7, multibody.getBaseVel());
    bs::store(state + 10, multibody.getBaseOmega());
  });
}

int32_t bs_base_state_set(bs_world *world, int32_t body, const double *state, int32_t length) {
  return bs::guarded(nullptr, 0, [&] {
    require(world != nullptr && state != nullptr, "null pointer");
    require(length == 13, "a base state is 13 values");
    const btQuaternion rotation(state[3], state[4], state[5], state[6]);
    require(btFabs(rotation.length2() - 1.0) < 1e-9, "a quaternion must be of unit length");
    btMultiBody &multibody = world->multibody(body);
    multibody.setBasePos(bs::vector(state));
    multibody.setWorldToBaseRot(rotation.inverse());
    multibody.setBaseVel(bs::vector(state + 7));
    multibody.setBaseOmega(bs::vector(state + 10));
  });
}

int32_t bs_link_states(bs_world *world, int32_t body, double *states, int32_t length) {
  return bs::guarded(nullptr, 0, [&] {
    require(world != nullptr && states != nullptr, "null pointer");
    const btMultiBody &multibody = world->multibody(body);
    require(length == 18 * multibody.getNumLinks(), "18 values per link");
    // Velocities of all bodies of the tree, each in its own frame, the base's first.
    const size_t count = static_cast<size_t>(multibody.getNumLinks()) + 1;
    if (world->scratch_linear.size() < count) {
      world->scratch_linear.resize(count);
      world->scratch_angular.resize(count);
    }
    multibody.compTreeLinkVelocities(world->scratch_angular.data(), world->scratch_linear.data());
    for (int i = 0; i < multibody.getNumLinks(); ++i) {
      const btTransform &transform = multibody.getLink(i).m_cachedWorldTransform;
      const size_t at = static_cast<size_t>(i) + 1;
      double *out = states + 18 * i;
      bs::store(out, transform.getOrigin());
      for (int row = 0; row < 3; ++row) bs::store(out + 3 + 3 * row, transform.getBasis()[row]);
      bs::store(out + 12, transform.getBasis() * world->scratch_linear[at]);
      bs::store(out + 15, transform.getBasis() * world->scratch_angular[at]);
    }
  });
}

int32_t bs_velocity_clamp(const bs_world *world, int32_t body, double *limit, double *largest) {
  return bs::guarded(nullptr, 0, [&] {
    require(world != nullptr && limit != nullptr && largest != nullptr, "null pointer");
    const btMultiBody &multibody = world->multibody(body);
    *limit = multibody.getMaxCoordinateVelocity();
    double found = 0;
    const btScalar *velocities = multibody.getVelocityVector();
    for (int i = 0; i < multibody.getNumDofs() + 6; ++i) found = btMax(found, btFabs(velocities[i]));
    *largest = found;
  });
}

int32_t bs_velocity_clamp_set(bs_world *world, int32_t body, double limit) {
  return bs::guarded(nullptr, 0, [&] {
    require(world != nullptr, "null pointer");
    require_positive(limit, "a velocity limit must be positive and finite");
    world->multibody(body).setMaxCoordinateVelocity(limit);
  });
}

}  // extern "C"
