#include "fixed.h"

#include <cmath>

#include "BulletDynamics/ConstraintSolver/btGeneric6DofSpring2Constraint.h"

namespace bs {

static constexpr int ROWS = 6;
static constexpr int BASE = -1;
static constexpr int SHIFT_IN_Z = 2, TURN_ABOUT_Y = 4;  // of the rows

FixedConstraint::FixedConstraint(btMultiBody *body, const btTransform &world)
    : btMultiBodyFixedConstraint(body, BASE, static_cast<btRigidBody *>(nullptr), btVector3(0, 0, 0), world.getOrigin(),
                                 btMatrix3x3::getIdentity(), world.getBasis()) {}

FixedConstraint::FixedConstraint(btMultiBody *body, const btTransform &world, const btVector3 &pivot, btScalar compliance,
                                 btScalar damping_time, btScalar hardening)
    : btMultiBodyFixedConstraint(body, BASE, static_cast<btRigidBody *>(nullptr), pivot, world(pivot), btMatrix3x3::getIdentity(),
                                 world.getBasis()),
      compliance_(compliance),
      damping_time_(damping_time),
      hardening_(hardening) {}

FixedConstraint::FixedConstraint(btMultiBody *body, const btVector3 &pivot, const btMatrix3x3 &frame, const btVector3 &world_pivot,
                                 const btMatrix3x3 &world_frame)
    : btMultiBodyFixedConstraint(body, BASE, static_cast<btRigidBody *>(nullptr), pivot, world_pivot, frame, world_frame) {}

void FixedConstraint::bend(btScalar width, const btScalar *compliances) {
  width_ = width;
  for (int i = 0; i < BS_CLAMP_POINTS; ++i) compliances_[i] = compliances[i];
}

void FixedConstraint::moment_of(btScalar turn, btScalar *moment, btScalar *compliance) const {
  const int middle = BS_CLAMP_POINTS / 2, side = turn < 0 ? -1 : 1;
  btScalar rest = std::abs(turn), below = 0;
  for (int i = 0; i < middle; ++i) {
    const btScalar low = compliances_[middle + side * i], high = compliances_[middle + side * (i + 1)], whole = btScalar(0.5) * (low + high) * width_;
    if (rest < whole) {
      // The smaller root of low m + (high - low) m^2 / (2 width) = rest; the root is the compliance there.
      const btScalar square = low * low + 2 * (high - low) / width_ * rest;
      *compliance = std::sqrt(square > 0 ? square : btScalar(0));
      *moment = std::copysign(below + 2 * rest / (low + *compliance), turn);
      return;
    }
    rest -= whole;
    below += width_;
  }
  *compliance = compliances_[middle + side * middle];
  *moment = std::copysign(below + rest / *compliance, turn);
}

void FixedConstraint::createConstraintRows(btMultiBodyConstraintArray &rows, btMultiBodyJacobianData &data,
                                           const btContactSolverInfo &info) {
  btMultiBody *body = m_bodyA;
  // A compliance is none of Bullet's.
  if ((AS_SHIPPED && is_rigid()) || !chain_.read(*body)) {
    return btMultiBodyFixedConstraint::createConstraintRows(rows, data, info);
  }

  const int freedoms = body->getNumDofs() + 6;
  if (body->getCompanionId() < 0) {
    body->setCompanionId(data.m_deltaVelocities.size());
    data.m_deltaVelocities.resize(data.m_deltaVelocities.size() + freedoms);
  }
  const int first = data.m_jacobians.size();
  data.m_jacobians.resizeNoInitialize(first + ROWS * freedoms);
  data.m_deltaVelocitiesUnitImpulse.resizeNoInitialize(first + ROWS * freedoms);

  const btVector3 zero(0, 0, 0);
  const btVector3 pivot = body->localPosToWorld(BASE, m_pivotInA);
  const btMatrix3x3 frame = body->localFrameToWorld(BASE, m_frameInA);
  const btVector3 offset = pivot - m_pivotInB;
  btVector3 turned;
  btGeneric6DofSpring2Constraint::matrixToEulerXYZ(frame.inverse() * m_frameInB, turned);

  Chain::Row responses[ROWS];
  for (int i = 0; i < ROWS; ++i) {
    Chain::Row &row = responses[i];
    row.point = pivot;
    row.linear = row.angular = zero;
    if (i < 3) {
      row.linear[i] = 1;
    } else {
      row.angular = frame.getColumn(i % 3);
    }
    row.jacobian = &data.m_jacobians[first + i * freedoms];
    row.response = &data.m_deltaVelocitiesUnitImpulse[first + i * freedoms];
    row.velocity = 0;
  }
  chain_.respond(BASE, responses, ROWS);

  for (int i = 0; i < ROWS; ++i) {
    const Chain::Row &row = responses[i];
    btMultiBodySolverConstraint &out = rows.expandNonInitializing();
    out.m_orgConstraint = this;
    out.m_orgDofIndex = i;
    out.m_multiBodyA = body;
    out.m_multiBodyB = nullptr;
    out.m_linkA = m_linkA;
    out.m_linkB = m_linkB;
    out.m_solverBodyIdA = out.m_solverBodyIdB = data.m_fixedBodyId;
    out.m_deltaVelAindex = body->getCompanionId();
    out.m_jacAindex = first + i * freedoms;
    out.m_relpos1CrossNormal = i < 3 ? (pivot - body->getBasePos()).cross(row.linear) : row.angular;
    out.m_contactNormal1 = row.linear;
    // The world does not answer, so its side stays empty.
    out.m_relpos2CrossNormal = out.m_contactNormal2 = out.m_angularComponentA = out.m_angularComponentB = zero;
    out.m_jacDiagABInv = row.inverse_mass > SIMD_EPSILON ? btScalar(1) / row.inverse_mass : btScalar(0);
    const btScalar error = i < 3 ? offset.dot(row.linear) : turned[i % 3];
    const btScalar position = -error * info.m_erp / info.m_timeStep, velocity = -row.velocity;
    out.m_rhs = position * out.m_jacDiagABInv + velocity * out.m_jacDiagABInv;
    out.m_cfm = 0;
    // Makes the row a spring of `compliance` c with a damper at the step's end: its impulse is -h (pull + whole omega) / c, omega the rate then.
    const auto soften = [&](btScalar compliance, btScalar whole, btScalar pull) {
      const btScalar softness = compliance / (info.m_timeStep * whole);
      out.m_jacDiagABInv = btScalar(1) / (row.inverse_mass + softness);
      out.m_cfm = softness * out.m_jacDiagABInv;
      out.m_rhs = (velocity - pull / whole) * out.m_jacDiagABInv;
    };
    if (i == TURN_ABOUT_Y && is_bent()) {
      // phi + (h + T) omega = C(M), about the moment M* of the present turn and rate: C(M*) + c (M - M*). The impulse is -h M.
      const btScalar rate = spin_.dot(row.angular);
      btScalar moment, compliance;
      moment_of(error + damping_time_ * rate, &moment, &compliance);
      soften(compliance, info.m_timeStep + damping_time_, compliance * moment - damping_time_ * rate);
    } else if (i == TURN_ABOUT_Y && compliance_ > 0) {
      // Of the moment and of its slope over the linear ones, at the present turn.
      const btScalar moment = 1 + hardening_ * hardening_ * error * error, slope = 3 * moment - 2;
      soften(compliance_, slope * info.m_timeStep + damping_time_, error * moment);
    } else if (i == SHIFT_IN_Z && shift_compliance_ > 0) {
      soften(shift_compliance_, info.m_timeStep + shift_damping_time_, error);
    }
    out.m_rhsPenetration = out.m_friction = out.m_appliedImpulse = out.m_appliedPushImpulse = 0;
    out.m_lowerLimit = -m_maxAppliedImpulse;
    out.m_upperLimit = m_maxAppliedImpulse;
  }
}

}  // namespace bs
