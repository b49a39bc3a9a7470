#include "solver.h"

#include "BulletCollision/NarrowPhaseCollision/btPersistentManifold.h"
#include "BulletDynamics/Featherstone/btMultiBody.h"
#include "BulletDynamics/Featherstone/btMultiBodyLinkCollider.h"
#include "impulse.h"

namespace bs {

static bool is_fixed(const btMultiBody &body) { return body.getNumLinks() == 0 && body.hasFixedBase(); }

// The chain of a collision object's body, read anew in every set-up; false if the object is not of the usual kind.
bool Solver::member(const btCollisionObject *object, Member &out) {
  const btMultiBodyLinkCollider *collider = btMultiBodyLinkCollider::upcast(object);
  if (collider == nullptr || object->hasAnisotropicFriction(btCollisionObject::CF_ANISOTROPIC_FRICTION)) return false;
  out = Member{collider->m_multiBody, collider->m_link, nullptr};
  if (is_fixed(*out.body)) return true;
  for (size_t i = 0; i < chain_count_; ++i) {
    if (chains_[i].body() == out.body) out.chain = &chains_[i];
  }
  if (out.chain != nullptr) return true;
  if (chain_count_ == chains_.size()) chains_.emplace_back();
  out.chain = &chains_[chain_count_++];
  return out.chain->read(*out.body);
}

// Reads the chains of all bodies that touch; false if any contact is of a kind that is left to Bullet.
bool Solver::read_chains(btPersistentManifold **manifolds, int manifold_count, const btContactSolverInfo &info) {
  constexpr int OTHER_MODES = SOLVER_USE_ARTICULATED_WARMSTARTING | SOLVER_ENABLE_FRICTION_DIRECTION_CACHING |
                              SOLVER_DISABLE_VELOCITY_DEPENDENT_FRICTION_DIRECTION;
  constexpr int OTHER_POINTS = BT_CONTACT_FLAG_HAS_CONTACT_CFM | BT_CONTACT_FLAG_HAS_CONTACT_ERP |
                               BT_CONTACT_FLAG_CONTACT_STIFFNESS_DAMPING | BT_CONTACT_FLAG_FRICTION_ANCHOR;
  chain_count_ = 0;
  if (AS_SHIPPED) return false;
  if ((info.m_solverMode & SOLVER_USE_2_FRICTION_DIRECTIONS) == 0 || (info.m_solverMode & OTHER_MODES) != 0) return false;
  for (int i = 0; i < manifold_count; ++i) {
    const btPersistentManifold &manifold = *manifolds[i];
    Member a, b;
    if (!member(manifold.getBody0(), a) || !member(manifold.getBody1(), b)) return false;
    if (a.chain != nullptr && b.chain != nullptr) return false;
    for (int j = 0; j < manifold.getNumContacts(); ++j) {
      const btManifoldPoint &point = manifold.getContactPoint(j);
      if ((point.m_contactPointFlags & OTHER_POINTS) != 0 || point.m_combinedSpinningFriction > 0 || point.m_combinedRollingFriction > 0) {
        return false;
      }
    }
  }
  return true;
}

void Solver::convertContacts(btPersistentManifold **manifolds, int manifold_count, const btContactSolverInfo &info) {
  if (!read_chains(manifolds, manifold_count, info)) return btMultiBodyConstraintSolver::convertContacts(manifolds, manifold_count, info);
  for (int i = 0; i < manifold_count; ++i) convert(*manifolds[i], info);
  // With no contacts left, this converts the joint constraints only.
  btMultiBodyConstraintSolver::convertContacts(nullptr, 0, info);
}

// Jacobians and responses of one body to rows, whose places follow the last ones; returns the first place.
int Solver::respond(const Member &member, Chain::Row *rows, int count) {
  const int freedoms = member.body->getNumDofs() + 6;
  if (member.body->getCompanionId() < 0) {
    member.body->setCompanionId(m_data.m_deltaVelocities.size());
    m_data.m_deltaVelocities.resize(m_data.m_deltaVelocities.size() + freedoms);
  }
  const int first = m_data.m_jacobians.size();
  m_data.m_jacobians.resizeNoInitialize(first + count * freedoms);
  m_data.m_deltaVelocitiesUnitImpulse.resizeNoInitialize(first + count * freedoms);
  for (int i = 0; i < count; ++i) {
    rows[i].jacobian = &m_data.m_jacobians[first + i * freedoms];
    rows[i].response = &m_data.m_deltaVelocitiesUnitImpulse[first + i * freedoms];
  }
  if (member.chain != nullptr) {
    member.chain->respond(member.link, rows, count);
    return first;
  }
  for (int i = 0; i < count; ++i) {
    const btVector3 turn = (rows[i].point - member.body->getBasePos()).cross(rows[i].linear);
    for (int k = 0; k < 3; ++k) {
      rows[i].jacobian[k] = turn[k];
      rows[i].jacobian[3 + k] = rows[i].linear[k];
    }
    for (int k = 0; k < 6; ++k) rows[i].response[k] = 0;
    rows[i].inverse_mass = 0;
  }
  return first;
}

// Makes the rows of one manifold: for each contact one along the normal and two of friction.
void Solver::convert(btPersistentManifold &manifold, const btContactSolverInfo &info) {
  constexpr int PER_CONTACT = 3;
  Member a, b;
  member(manifold.getBody0(), a);
  member(manifold.getBody1(), b);
  Chain::Row rows_a[Chain::MAX_ROWS], rows_b[Chain::MAX_ROWS];
  btManifoldPoint *points[Chain::MAX_ROWS / PER_CONTACT];
  static_assert(MANIFOLD_CACHE_SIZE * PER_CONTACT == Chain::MAX_ROWS, "a manifold's rows go together");
  int contacts = 0;
  for (int i = 0; i < manifold.getNumContacts(); ++i) {
    btManifoldPoint &point = manifold.getContactPoint(i);
    if (point.getDistance() > manifold.getContactProcessingThreshold()) {
      point.m_appliedImpulse = 0;
      point.m_prevRHS = 0;
      continue;
    }
    btPlaneSpace1(point.m_normalWorldOnB, point.m_lateralFrictionDir1, point.m_lateralFrictionDir2);
    point.m_lateralFrictionDir1.normalize();
    point.m_lateralFrictionDir2.normalize();
    const btVector3 *directions[PER_CONTACT] = {&point.m_normalWorldOnB, &point.m_lateralFrictionDir1, &point.m_lateralFrictionDir2};
    for (int k = 0; k < PER_CONTACT; ++k) {
      Chain::Row &row_a = rows_a[PER_CONTACT * contacts + k], &row_b = rows_b[PER_CONTACT * contacts + k];
      row_a.point = point.getPositionWorldOnA();
      row_b.point = point.getPositionWorldOnB();
      row_a.linear = *directions[k];
      row_b.linear = -*directions[k];
      row_a.angular = row_b.angular = btVector3(0, 0, 0);
      row_a.velocity = 0;
    }
    points[contacts++] = &point;
  }
  if (contacts == 0) return;

  const int count = PER_CONTACT * contacts;
  const int first_a = respond(a, rows_a, count);
  for (int i = 0; i < count; ++i) rows_b[i].velocity = rows_a[i].velocity;
  const int first_b = respond(b, rows_b, count);
  // respond(b) may have reallocated the storage of a's rows, so they are addressed by index.
  const int freedoms_a = a.body->getNumDofs() + 6, freedoms_b = b.body->getNumDofs() + 6;
  for (int i = 0; i < count; ++i) {
    const bool is_friction = i % PER_CONTACT != 0;
    const int normal = m_multiBodyNormalContactConstraints.size() - (is_friction ? 1 : 0);
    btMultiBodyConstraintArray &list = is_friction ? m_multiBodyFrictionContactConstraints : m_multiBodyNormalContactConstraints;
    btMultiBodySolverConstraint &out = list.expandNonInitializing();
    out.m_frictionIndex = is_friction ? normal : m_multiBodyFrictionContactConstraints.size();
    out.m_multiBodyA = a.body;
    out.m_multiBodyB = b.body;
    out.m_linkA = a.link;
    out.m_linkB = b.link;
    out.m_deltaVelAindex = a.body->getCompanionId();
    out.m_deltaVelBindex = b.body->getCompanionId();
    out.m_jacAindex = first_a + i * freedoms_a;
    out.m_jacBindex = first_b + i * freedoms_b;
    out.m_originalContactPoint = points[i / PER_CONTACT];
    fill(out, rows_a[i], rows_b[i], *points[i / PER_CONTACT], is_friction, info);
  }
}

static btVector3 origin(const btMultiBody &body, int link) {
  return link < 0 ? body.getBasePos() : body.getLink(link).m_cachedWorldTransform.getOrigin();
}

// Target and limits of one contact row, as in btMultiBodyConstraintSolver::setupMultiBodyContactConstraint.
void Solver::fill(btMultiBodySolverConstraint &out, const Chain::Row &a, const Chain::Row &b, const btManifoldPoint &point,
                  bool is_friction, const btContactSolverInfo &info) {
  out.m_orgConstraint = nullptr;
  out.m_orgDofIndex = -1;
  out.m_solverBodyIdA = out.m_solverBodyIdB = -1;
  out.m_relpos1CrossNormal = (a.point - origin(*out.m_multiBodyA, out.m_linkA)).cross(a.linear);
  out.m_contactNormal1 = a.linear;
  out.m_relpos2CrossNormal = -(b.point - origin(*out.m_multiBodyB, out.m_linkB)).cross(a.linear);
  out.m_contactNormal2 = b.linear;

  const btScalar softness = (is_friction ? info.m_frictionCFM : info.m_globalCfm) * (btScalar(1) / info.m_timeStep);
  const btScalar inverse_mass = a.inverse_mass + b.inverse_mass + softness;
  out.m_jacDiagABInv = inverse_mass > SIMD_EPSILON ? info.m_sor / inverse_mass : btScalar(0);
  out.m_cfm = softness * out.m_jacDiagABInv;
  out.m_friction = point.m_combinedFriction;

  btScalar position = 0, velocity = -b.velocity;
  if (is_friction) {
    out.m_lowerLimit = -out.m_friction;
    out.m_upperLimit = out.m_friction;
  } else {
    const btScalar restitution = restitutionCurve(b.velocity, point.m_combinedRestitution, info.m_restitutionVelocityThreshold);
    velocity = btMax(restitution, btScalar(0)) - b.velocity;
    const btScalar distance = point.getDistance() + info.m_linearSlop;
    if (restitution > 0 && distance + b.velocity * info.m_timeStep <= 0) {
      // A bounce in this step. The gap that is left, or the push out of an overlap, would change its speed by as much as the approach:
      // both are at most what one step goes.
    } else if (distance > 0) {
      velocity -= distance / info.m_timeStep;
    } else {
      position = -distance * info.m_erp2 / info.m_timeStep;
    }
    out.m_lowerLimit = 0;
    out.m_upperLimit = btScalar(1e10f);
  }
  out.m_rhs = position * out.m_jacDiagABInv + velocity * out.m_jacDiagABInv;
  out.m_rhsPenetration = 0;
  out.m_appliedImpulse = 0;
  out.m_appliedPushImpulse = 0;
}

Solver::Side Solver::side(btMultiBody *body, int jacobian, int velocity) {
  if (is_fixed(*body)) return Side{nullptr, nullptr, nullptr, nullptr, 0, 0};
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
  if (AS_SHIPPED) return false;
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

// The change of impulse that would meet the row's target, before any limit.
btScalar Solver::wanted(const Row &row) {
  const btMultiBodySolverConstraint &c = *row.constraint;
  btScalar impulse = c.m_rhs - btScalar(c.m_appliedImpulse) * c.m_cfm;
  impulse -= dot(row.a.jacobian, row.a.velocity_changes, row.a.nonzero) * c.m_jacDiagABInv;
  impulse -= dot(row.b.jacobian, row.b.velocity_changes, row.b.nonzero) * c.m_jacDiagABInv;
  return impulse;
}

void Solver::apply(const Row &row, btScalar impulse) {
  add_impulse(row.a.response, impulse, row.a.velocity_changes, row.a.body_changes, row.a.count);
  add_impulse(row.b.response, impulse, row.b.velocity_changes, row.b.body_changes, row.b.count);
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
