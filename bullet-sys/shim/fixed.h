// Bullet's fixed constraint with a faster set-up of its rows, at equal bits.
#ifndef BULLET_SHIM_FIXED_H
#define BULLET_SHIM_FIXED_H

#include "BulletDynamics/Featherstone/btMultiBodyFixedConstraint.h"

#include "chain.h"

namespace bs {

// Ties the base of a chain to the world. Bullet computes the pose's error and both frames anew for each of the six rows, and each
// row's response by itself; here once per step, and the rows together. A body that is no chain is left to Bullet.
class FixedConstraint : public btMultiBodyFixedConstraint {
 public:
  FixedConstraint(btMultiBody *body, const btTransform &world);
  void createConstraintRows(btMultiBodyConstraintArray &rows, btMultiBodyJacobianData &data, const btContactSolverInfo &info) override;

 private:
  Chain chain_;
};

}  // namespace bs

#endif
