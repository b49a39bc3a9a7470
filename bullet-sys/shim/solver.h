// Bullet's multibody solver with a faster set-up of contact rows and a faster sweep over all rows, at equal bits.
#ifndef BULLET_SHIM_SOLVER_H
#define BULLET_SHIM_SOLVER_H

#include <vector>

#include "BulletDynamics/Featherstone/btMultiBodyConstraintSolver.h"

#include "chain.h"

namespace bs {

// Set-up: the three rows of each contact, normal and two of friction, are those of btMultiBodyConstraintSolver::convertContacts. The
// rows of a manifold go through its chain together (see chain.h).
//
// One Gauss-Seidel sweep does the same scalar operations in the same order as Bullet's, so its results have the same bits, but
//  - the products with the zeros at the end of a row's Jacobian (a contact of link i does not feel the joints after i) are left out:
//    a sum that began at +0 does not change by adding a zero;
//  - so is everything on the side of a fixed body without links, whose velocity changes stay zero;
//  - updates of velocities, where every element is on its own, run two at a time.
// Contacts and rows of other kinds than these robots have (rigid bodies, bodies that are no chains, chains that touch each other,
// rolling or spinning friction, pyramid friction, warm starting) are left to Bullet.
class Solver : public btMultiBodyConstraintSolver {
 protected:
  void convertContacts(btPersistentManifold **manifolds, int manifold_count, const btContactSolverInfo &info) override;
  btScalar solveSingleIteration(int iteration, btCollisionObject **bodies, int body_count, btPersistentManifold **manifolds,
                                int manifold_count, btTypedConstraint **constraints, int constraint_count,
                                const btContactSolverInfo &info, btIDebugDraw *debug) override;

 private:
  // One side of a row: where its Jacobian, unit response and velocity changes begin, and how far they matter. An absent side has
  // count 0.
  struct Side {
    const btScalar *jacobian;
    const btScalar *response;   // velocity changes by a unit impulse
    btScalar *velocity_changes;  // of this group of constraints
    btScalar *body_changes;      // the multibody's own sum of them
    int nonzero;                 // up to the last nonzero of the Jacobian
    int count;
  };
  struct Row {
    const btMultiBodySolverConstraint *constraint;
    Side a, b;
  };

  // One body of a manifold, in the set-up.
  struct Member {
    btMultiBody *body;
    int link;
    Chain *chain;  // null for a fixed body without links
  };

  bool read_chains(btPersistentManifold **manifolds, int manifold_count, const btContactSolverInfo &info);
  bool member(const btCollisionObject *object, Member &out);
  void convert(btPersistentManifold &manifold, const btContactSolverInfo &info);
  int respond(const Member &member, Chain::Row *rows, int count);
  void fill(btMultiBodySolverConstraint &out, const Chain::Row &a, const Chain::Row &b, const btManifoldPoint &point, bool is_friction,
            const btContactSolverInfo &info);

  bool prepare(const btContactSolverInfo &info);
  bool add_rows(const btMultiBodyConstraintArray &constraints, std::vector<Row> &rows);
  bool is_rigid(int solver_body) const;
  Side side(btMultiBody *body, int jacobian, int velocity);

  static btScalar wanted(const Row &row);
  static void apply(const Row &row, btScalar impulse);
  static btScalar solve(const Row &row);
  static btScalar solve_cone(const Row &a, const Row &b);

  std::vector<Chain> chains_;  // those of this set-up come first; the rest are kept for their memory
  size_t chain_count_ = 0;
  std::vector<Row> non_contact_, normal_, friction_;
  bool usual_ = false;
};

}  // namespace bs

#endif
