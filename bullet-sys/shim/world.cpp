// The world: identity of the build, solver settings, stepping.
#include <dlfcn.h>

#include <cstddef>
#include <mutex>

#include "internal.h"

extern btScalar gDbvtMargin;

static void clear_broadphase_margin() {
  static std::once_flag once;
  std::call_once(once, [] { gDbvtMargin = 0; });
}

bs_world::bs_world(const bs_settings &s)
    : dispatcher(&configuration), broadphase(&pair_cache), dynamics(&dispatcher, &broadphase, &solver, &configuration) {
  clear_broadphase_margin();
  broadphase.setVelocityPrediction(s.broadphase_velocity_prediction);
  dynamics.setForceUpdateAllAabbs(s.force_update_all_aabbs != 0);
  dynamics.setGravity(bs::vector(s.gravity));
  btContactSolverInfo &info = dynamics.getSolverInfo();
  info.m_erp2 = s.erp2;
  info.m_frictionERP = s.friction_erp;
  info.m_linearSlop = s.linear_slop;
  info.m_warmstartingFactor = s.warmstarting_factor;
  info.m_leastSquaresResidualThreshold = s.least_squares_residual_threshold;
  info.m_numIterations = s.solver_iterations;
  info.m_minimumSolverBatchSize = s.minimum_solver_batch_size;
}

bs_world::~bs_world() {
  for (auto &constraint : constraints) dynamics.removeMultiBodyConstraint(constraint.get());
  constraints.clear();
  for (auto &body : bodies) {
    for (auto &motor : body.motors) {
      if (motor) dynamics.removeMultiBodyConstraint(motor.get());
    }
    dynamics.removeMultiBody(body.multibody.get());
    for (auto &collider : body.colliders) dynamics.removeCollisionObject(collider.get());
  }
  bodies.clear();
}

extern "C" {

int32_t bs_abi_version(void) { return BS_ABI_VERSION; }
int32_t bs_scalar_size(void) { return sizeof(btScalar); }
int32_t bs_bullet_version(void) { return btGetVersion(); }

int32_t bs_linked_scalar_size(void) {
  // A function that takes a scalar by value carries the scalar's type in its symbol (d or f), so the loaded libraries can be asked
  // without calling into code of the wrong precision. Taking the function's address keeps the library linked even in a program
  // that uses nothing else of it.
  void (btMultiBody::*volatile anchor)(btScalar, btScalar *, btScalar *) = &btMultiBody::stepPositionsMultiDof;
  (void)anchor;
  if (dlsym(RTLD_DEFAULT, "_ZN11btMultiBody21stepPositionsMultiDofEdPdS0_") != nullptr) return sizeof(double);
  if (dlsym(RTLD_DEFAULT, "_ZN11btMultiBody21stepPositionsMultiDofEfPfS0_") != nullptr) return sizeof(float);
  return 0;
}

void bs_layout(int32_t *sizes, int32_t length) {
  const size_t values[8] = {sizeof(bs_settings),
                            sizeof(bs_link),
                            sizeof(bs_contact),
                            sizeof(bs_tree_body),
                            offsetof(bs_settings, reserved),
                            offsetof(bs_link, reserved),
                            offsetof(bs_contact, link_b),
                            offsetof(bs_tree_body, reserved)};
  for (int32_t i = 0; i < 8 && i < length; ++i) sizes[i] = static_cast<int32_t>(values[i]);
}

int32_t bs_world_create(const bs_settings *settings, bs_world **world, char *error, int32_t error_length) {
  return bs::guarded(error, error_length, [&] {
    bs::require(settings != nullptr && world != nullptr, "null pointer");
    bs::require(settings->solver_iterations > 0, "solver_iterations must be positive");
    *world = new bs_world(*settings);
  });
}

void bs_world_destroy(bs_world *world) { delete world; }

int32_t bs_world_step(bs_world *world, double time_step, char *error, int32_t error_length) {
  return bs::guarded(error, error_length, [&] {
    bs::require(world != nullptr, "null pointer");
    // Bullet takes a step within SIMD_EPSILON of zero for no step at all.
    bs::require(time_step > SIMD_EPSILON, "the time step must be above 2.2e-16 s");
    for (const auto &constraint : world->constraints) constraint->begin_step();
    for (bs::Body &body : world->bodies) body.damp_joints();
    world->dynamics.stepSimulation(time_step, 0);
    for (bs::Body &body : world->bodies) body.move_colliders();
  });
}

int32_t bs_world_set_gravity(bs_world *world, const double *gravity) {
  return bs::guarded(nullptr, 0, [&] {
    bs::require(world != nullptr && gravity != nullptr, "null pointer");
    world->dynamics.setGravity(bs::vector(gravity));
  });
}

}  // extern "C"
