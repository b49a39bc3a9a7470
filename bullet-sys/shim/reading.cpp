// What PyBullet reads of a body, by the same operations.
#include "internal.h"

using bs::require;

namespace {

void store(double *out, const btQuaternion &q) {
  for (int i = 0; i < 4; ++i) out[i] = q[i];
}

}  // namespace

extern "C" {

int32_t bs_motor_impulses(const bs_world *world, int32_t body, double *impulses, int32_t length) {
  return bs::guarded(nullptr, 0, [&] {
    require(world != nullptr && impulses != nullptr, "null pointer");
    const auto &motors = world->body(body).motors;
    require(length >= 0 && static_cast<size_t>(length) == motors.size(), "one value per link");
    for (size_t i = 0; i < motors.size(); ++i) impulses[i] = motors[i] ? motors[i]->getAppliedImpulse(0) : 0;
  });
}

int32_t bs_base_reading(const bs_world *world, int32_t body, double *state, int32_t length) {
  return bs::guarded(nullptr, 0, [&] {
    require(world != nullptr && state != nullptr, "null pointer");
    require(length == 13, "a base state is 13 values");
    const btMultiBody &multibody = world->multibody(body);
    btTransform transform;
    transform.setOrigin(multibody.getBasePos());
    transform.setRotation(multibody.getWorldToBaseRot().inverse());
    bs::store(state, transform.getOrigin());
    store(state + 3, transform.getRotation());
    bs::store(state + 7, multibody.getBaseVel());
    bs::store(state + 10, multibody.getBaseOmega());
  });
}

int32_t bs_link_readings(bs_world *world, int32_t body, int32_t with_velocities, double *states, int32_t length) {
  return bs::guarded(nullptr, 0, [&] {
    require(world != nullptr && states != nullptr, "null pointer");
    const btMultiBody &multibody = world->multibody(body);
    const auto &frames = world->body(body).inertial_frames;
    const size_t links = static_cast<size_t>(multibody.getNumLinks());
    require(length >= 0 && static_cast<size_t>(length) == 20 * links && frames.size() == links, "20 values per link of a tree");
    if (with_velocities != 0) {
      if (world->scratch_linear.size() < links + 1) {
        world->scratch_linear.resize(links + 1);
        world->scratch_angular.resize(links + 1);
      }
      multibody.compTreeLinkVelocities(world->scratch_angular.data(), world->scratch_linear.data());
    }
    const btVector3 zero(0, 0, 0);
    for (size_t i = 0; i < links; ++i) {
      const btTransform &transform = multibody.getLink(static_cast<int>(i)).m_cachedWorldTransform;
      double *out = states + 20 * i;
      bs::store(out, transform.getOrigin());
      store(out + 3, transform.getRotation());
      bs::store(out + 7, with_velocities != 0 ? transform.getBasis() * world->scratch_linear[i + 1] : zero);
      bs::store(out + 10, with_velocities != 0 ? transform.getBasis() * world->scratch_angular[i + 1] : zero);
      bs::store(out + 13, frames[i].getOrigin());
      store(out + 16, frames[i].getRotation());
    }
  });
}

}  // extern "C"
