#include "solver.h"

#include <emmintrin.h>

#include "BulletDynamics/Featherstone/btMultiBody.h"

namespace bs {

Solver::Side Solver::side(btMultiBody *body, int jacobian, int velocity) {
  if (body->getNumLinks() == 0 && body->hasFixedBase()) return Side{nullptr, nullptr, nullptr, nullptr, 0, 0};
  const int count = body->getNumDofs() + 6;
  const btScalar *row = &m_data.m_jacobians[jacobian];
  int nonzero = count;
  while (nonzero > 0 && row[nonzero - 1] == 0) --nonzero;
  return Side{row,
              &m_data.m_deltaVelocitiesUnitImpulse[jacobian],
              &m_data.m_deltaVelocities[velocity],
              const_cast<btScalar *>(body->getDeltaVelocityVector()),
              nonzero,
              count};
}

// Whether a solver body can move. The world, to which a fixed constraint ties, is one without a rigid body behind it.
bool Solver::is_rigid(int solver_body) const { return solver_body >= 0 && m_tmpSolverBodyPool[solver_body].m_originalBody != nullptr; }

bool Solver::add_rows(const btMultiBodyConstraintArray &constraints, std::vector<Row> &rows) {
  rows.clear();
  const Side none{nullptr, nullptr, nullptr, nullptr, 0, 0};
  for (int i = 0; i < constraints.size(); ++i) {
    const btMultiBodySolverConstraint &c = constraints[i];
    if ((c.m_multiBodyA == nullptr && is_rigid(c.m_solverBodyIdA)) || (c.m_multiBodyB == nullptr && is_rigid(c.m_solverBodyIdB))) return false;
    rows.push_back(Row{&c, c.m_multiBodyA ? side(c.m_multiBodyA, c.m_jacAindex, c.m_deltaVelAindex) : none,
                       c.m_multiBodyB ? side(c.m_multiBodyB, c.m_jacBindex, c.m_deltaVelBindex) : none});
  }
  return true;
}

// Lists the rows of this solve; false if one is of a kind that is left to Bullet.
bool Solver::prepare(const btContactSolverInfo &info) {
  const bool cone = (info.m_solverMode & SOLVER_USE_2_FRICTION_DIRECTIONS) != 0 &&
                    (info.m_solverMode & SOLVER_DISABLE_IMPLICIT_CONE_FRICTION) == 0;
  if (m_multiBodySpinningFrictionContactConstraints.size() != 0 || m_multiBodyTorsionalFrictionContactConstraints.size() != 0) return false;
  if (m_tmpSolverNonContactConstraintPool.size() != 0 || m_tmpSolverContactConstraintPool.size() != 0) return false;
  if (!cone && m_multiBodyFrictionContactConstraints.size() != 0) return false;
  if (!add_rows(m_multiBodyNonContactConstraints, non_contact_) || !add_rows(m_multiBodyNormalContactConstraints, normal_) ||
      !add_rows(m_multiBodyFrictionContactConstraints, friction_)) {
    return false;
  }
  if (friction_.size() % 2 != 0) return false;
  for (size_t i = 0; i < friction_.size(); i += 2) {
    if (friction_[i].constraint->m_frictionIndex != friction_[i + 1].constraint->m_frictionIndex) return false;
  }
  return true;
}

static inline btScalar dot(const btScalar *a, const btScalar *b, int count) {
  btScalar sum = 0;
  for (int i = 0; i < count; ++i) sum += a[i] * b[i];
  return sum;
}

// changes[i] += response[i] * impulse, for both sums of changes.
static inline void add(const btScalar *response, btScalar impulse, btScalar *changes, btScalar *body_changes, int count) {
  const __m128d both = _mm_set1_pd(impulse);
  int i = 0;
  for (; i + 2 <= count; i += 2) {
    const __m128d step = _mm_mul_pd(_mm_loadu_pd(response + i), both);
    _mm_storeu_pd(changes + i, _mm_add_pd(_mm_loadu_pd(changes + i), step));
    _mm_storeu_pd(body_changes + i, _mm_add_pd(_mm_loadu_pd(body_changes + i), step));
  }
  for (; i < count; ++i) {
    const btScalar step = response[i] * impulse;
    changes[i] += step;
    body_changes[i] += step;
  }
}

// The change of impulse that would meet the row's target, before any limit.
btScalar Solver::wanted(const Row &row) {
  const btMultiBodySolverConstraint &c = *row.constraint;
  btScalar impulse = c.m_rhs - btScalar(c.m_appliedImpulse) * c.m_cfm;
  impulse -= dot(row.a.jacobian, row.a.velocity_changes, row.a.nonzero) * c.m_jacDiagABInv;
  impulse -= dot(row.b.jacobian, row.b.velocity_changes, row.b.nonzero) * c.m_jacDiagABInv;
  return impulse;
}

void Solver::apply(const Row &row, btScalar impulse) {
  add(row.a.response, impulse, row.a.velocity_changes, row.a.body_changes, row.a.count);
  add(row.b.response, impulse, row.b.velocity_changes, row.b.body_changes, row.b.count);
}

// Solves one row within its limits; returns the change of relative velocity.
btScalar Solver::solve(const Row &row) {
  const btMultiBodySolverConstraint &c = *row.constraint;
  btScalar impulse = wanted(row);
  const btScalar applied = c.m_appliedImpulse;
  const btScalar sum = applied + impulse;
  if (sum < c.m_lowerLimit) {
    impulse = c.m_lowerLimit - applied;
    c.m_appliedImpulse = c.m_lowerLimit;
  } else if (sum > c.m_upperLimit) {
    impulse = c.m_upperLimit - applied;
    c.m_appliedImpulse = c.m_upperLimit;
  } else {
    c.m_appliedImpulse = sum;
  }
  apply(row, impulse);
  return impulse / c.m_jacDiagABInv;
}

// Limits one component of friction to +-limit; returns the change of impulse.
static inline btScalar clip(const btMultiBodySolverConstraint &c, btScalar sum, btScalar limit, btScalar impulse) {
  const btScalar applied = c.m_appliedImpulse;
  if (sum < -limit) {
    c.m_appliedImpulse = -limit;
    return -limit - applied;
  }
  if (sum > limit) {
    c.m_appliedImpulse = limit;
    return limit - applied;
  }
  c.m_appliedImpulse = sum;
  return impulse;
}

// Solves the two friction rows of a contact together, within the friction cone.
btScalar Solver::solve_cone(const Row &row_a, const Row &row_b) {
  const btMultiBodySolverConstraint &a = *row_a.constraint;
  const btMultiBodySolverConstraint &b = *row_b.constraint;
  btScalar impulse_b = wanted(row_b);
  btScalar impulse_a = wanted(row_a);
  const btScalar sum_b = btScalar(b.m_appliedImpulse) + impulse_b;
  const btScalar sum_a = btScalar(a.m_appliedImpulse) + impulse_a;
  if (sum_a * sum_a + sum_b * sum_b >= a.m_lowerLimit * b.m_lowerLimit) {
    const btScalar angle = btAtan2(sum_a, sum_b);
    impulse_a = clip(a, sum_a, btFabs(a.m_lowerLimit * btSin(angle)), impulse_a);
    impulse_b = clip(b, sum_b, btFabs(b.m_lowerLimit * btCos(angle)), impulse_b);
  } else {
    a.m_appliedImpulse = sum_a;
    b.m_appliedImpulse = sum_b;
  }
  apply(row_a, impulse_a);
  apply(row_b, impulse_b);
  return impulse_a / a.m_jacDiagABInv + impulse_b / b.m_jacDiagABInv;
}

btScalar Solver::solveSingleIteration(int iteration, btCollisionObject **bodies, int body_count, btPersistentManifold **manifolds,
                                      int manifold_count, btTypedConstraint **constraints, int constraint_count,
                                      const btContactSolverInfo &info, btIDebugDraw *debug) {
  // The rows stay where they are from the first sweep of a solve to its last.
  if (iteration == 0) usual_ = prepare(info);
  if (!usual_ || iteration >= info.m_numIterations) {
    return btMultiBodyConstraintSolver::solveSingleIteration(iteration, bodies, body_count, manifolds, manifold_count, constraints,
                                                             constraint_count, info, debug);
  }
  btScalar non_contact = 0;
  for (int inner = 0; inner < info.m_numNonContactInnerIterations; ++inner) {
    non_contact = 0;
    const size_t count = non_contact_.size();
    for (size_t i = 0; i < count; ++i) {
      const btScalar change = solve(non_contact_[iteration & 1 ? i : count - 1 - i]);
      non_contact = btMax(non_contact, change * change);
    }
  }
  btScalar residual = btMax(btScalar(0), non_contact);
  for (const Row &row : normal_) {
    const btScalar change = solve(row);
    residual = btMax(residual, change * change);
  }
  for (size_t i = 0; i < friction_.size(); i += 2) {
    const btMultiBodySolverConstraint &a = *friction_[i].constraint;
    const btMultiBodySolverConstraint &b = *friction_[i + 1].constraint;
    const btScalar normal_impulse = normal_[static_cast<size_t>(a.m_frictionIndex)].constraint->m_appliedImpulse;
    for (const btMultiBodySolverConstraint *c : {&a, &b}) {
      auto &limits = const_cast<btMultiBodySolverConstraint &>(*c);
      limits.m_lowerLimit = -(c->m_friction * normal_impulse);
      limits.m_upperLimit = c->m_friction * normal_impulse;
    }
    const btScalar change = solve_cone(friction_[i], friction_[i + 1]);
    residual = btMax(residual, change * change);
  }
  return residual;
}

}  // namespace bs
