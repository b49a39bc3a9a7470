// Contact points of the last step, in Bullet's order.
#include "internal.h"

namespace {

// Index of the multibody and link that a collision object belongs to.
void locate(const bs_world &world, const btCollisionObject &object, int32_t &body, int32_t &link) {
  const btMultiBodyLinkCollider *collider = btMultiBodyLinkCollider::upcast(&object);
  link = collider->m_link;
  body = -1;
  for (size_t i = 0; i < world.bodies.size(); ++i) {
    if (world.bodies[i].multibody.get() == collider->m_multiBody) body = static_cast<int32_t>(i);
  }
}

}  // namespace

extern "C" int32_t bs_contacts(const bs_world *world, bs_contact *contacts, int32_t capacity, int32_t *count) {
  return bs::guarded(nullptr, 0, [&] {
    bs::require(world != nullptr && count != nullptr && (capacity <= 0 || contacts != nullptr), "null pointer");
    int32_t found = 0;
    for (int m = 0; m < world->dispatcher.getNumManifolds(); ++m) {
      const btPersistentManifold &manifold = *const_cast<bs::Dispatcher &>(world->dispatcher).getManifoldByIndexInternal(m);
      for (int p = 0; p < manifold.getNumContacts(); ++p, ++found) {
        if (found >= capacity) continue;
        const btManifoldPoint &point = manifold.getContactPoint(p);
        bs_contact &out = contacts[found];
        bs::store(out.position_on_b, point.m_positionWorldOnB);
        bs::store(out.normal_on_b, point.m_normalWorldOnB);
        out.distance = point.m_distance1;
        out.normal_impulse = point.m_appliedImpulse;
        out.friction_impulse[0] = point.m_appliedImpulseLateral1;
        out.friction_impulse[1] = point.m_appliedImpulseLateral2;
        bs::store(out.friction_direction_1, point.m_lateralFrictionDir1);
        bs::store(out.friction_direction_2, point.m_lateralFrictionDir2);
        locate(*world, *manifold.getBody0(), out.body_a, out.link_a);
        locate(*world, *manifold.getBody1(), out.body_b, out.link_b);
      }
    }
    *count = found;
  });
}
