// Bullet's fixed constraint with a faster set-up of its rows, at equal bits.
#ifndef BULLET_SHIM_FIXED_H
#define BULLET_SHIM_FIXED_H

#include "BulletDynamics/Featherstone/btMultiBodyFixedConstraint.h"

#include "bullet_shim.h"
#include "chain.h"

namespace bs {

// Ties the base of a chain to the world. Bullet computes the pose's error and both frames anew for each of the six rows, and each
// row's response by itself; here once per step, and the rows together. A body that is no chain is left to Bullet.
//
// With a compliance c the base turns about its y axis as a spring lets it, at a pivot of its own. The row of that turn is so soft that its
// impulse is that of the spring and its damper at the step's end, -h (phi + (h + T) omega) / c: implicit Euler, stable for any c and T, rigid in
// the limit. The compliance may depend on the moment. With a shift compliance the base gives in z alike, under the force on it.
class FixedConstraint : public btMultiBodyFixedConstraint {
 public:
  FixedConstraint(btMultiBody *body, const btTransform &world);
  FixedConstraint(btMultiBody *body, const btTransform &world, const btVector3 &pivot, btScalar compliance,
                  btScalar damping_time, btScalar hardening);
  // Ties `pivot` and `frame` of the base to `world_pivot` and `world_frame`.
  FixedConstraint(btMultiBody *body, const btVector3 &pivot, const btMatrix3x3 &frame, const btVector3 &world_pivot,
                  const btMatrix3x3 &world_frame);
  // Lets the compliance depend on the moment: `compliances` at multiples of `width` from 0, linear between them, constant beyond.
  void bend(btScalar width, const btScalar *compliances);
  bool is_bent() const { return width_ > 0; }
  bool is_rigid() const { return compliance_ == 0 && shift_compliance_ == 0 && !is_bent(); }
  btScalar width() const { return width_; }
  btScalar bent_compliance(int point) const { return compliances_[point]; }
  const btVector3 &pivot() const { return m_pivotInA; }
  btScalar compliance() const { return compliance_; }
  btScalar damping_time() const { return damping_time_; }
  btScalar hardening() const { return hardening_; }
  btScalar shift_compliance() const { return shift_compliance_; }
  btScalar shift_damping_time() const { return shift_damping_time_; }
  void set_shift(btScalar compliance, btScalar damping_time) {
    shift_compliance_ = compliance;
    shift_damping_time_ = damping_time;
  }
  // Keeps the base's rate: rows are made after forces have changed it.
  void begin_step() { spin_ = m_bodyA->getBaseOmega(); }
  void createConstraintRows(btMultiBodyConstraintArray &rows, btMultiBodyJacobianData &data, const btContactSolverInfo &info) override;

 private:
  // The moment of a turn, and the compliance there.
  void moment_of(btScalar turn, btScalar *moment, btScalar *compliance) const;

  Chain chain_;
  btScalar compliance_ = 0;                      // of the turn about y (rad/(dyn cm))
  btScalar damping_time_ = 0;                    // its damping over its stiffness (s)
  btScalar hardening_ = 0;                       // a of its moment phi (1 + (a phi)^2) / compliance (1/rad)
  btScalar width_ = 0;                           // between two points of its curve (dyn cm); 0 without one
  btScalar compliances_[BS_CLAMP_POINTS] = {0};  // at these points (rad/(dyn cm)), all positive
  btVector3 spin_ = btVector3(0, 0, 0);          // of the base at the step's start (rad/s)
  btScalar shift_compliance_ = 0;                // of the shift in z (cm/dyn)
  btScalar shift_damping_time_ = 0;              // its damping over its stiffness (s)
};

}  // namespace bs

#endif
