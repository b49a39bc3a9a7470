// The response of a chain of hinged links to rows of constraints, many rows at a time.
#ifndef BULLET_SHIM_CHAIN_H
#define BULLET_SHIM_CHAIN_H

#include <vector>

#include "BulletDynamics/Featherstone/btMultiBody.h"

namespace bs {

// Whether all rows are left to Bullet's own code, for comparing with it.
#ifdef BULLET_SHIM_AS_SHIPPED
constexpr bool AS_SHIPPED = true;
#else
constexpr bool AS_SHIPPED = false;
#endif

// For every row of a constraint Bullet computes a Jacobian (btMultiBody::fillConstraintJacobianMultiDof) and the accelerations by a
// unit force along it (calcAccelerationDeltasMultiDof). Here the same scalar operations are done in the same order, so the results
// have the same bits, but
//  - what depends on the pose only is computed or fetched once per solve, in read(), not once per row;
//  - links beyond the row's own are skipped on the way to the base, where all their values are zero;
//  - two rows go side by side, and the pairs of one link take turns at each joint.
// Only the sign of a zero may come out differently; such zeros are then added to sums that began at +0, which do not change by it.
class Chain {
 public:
  static constexpr int MAX_ROWS = 12;  // three rows for each of a manifold's four contacts

  // One row on a link: a unit force along `linear` at `point` and a unit torque along `angular` (on the base only).
  struct Row {
    btVector3 point, linear, angular;
    btScalar *jacobian, *response;  // out: 6 + number of joints each, base's rotation, base's translation, joints
    btScalar velocity;              // in and out: the body's velocity along the row is added
    btScalar inverse_mass;          // out: response along the row itself
  };

  // Takes the body's pose and articulated inertia of this step; false if the body is of a kind that is left to Bullet.
  bool read(const btMultiBody &body);
  void respond(int link, Row *rows, int count);
  const btMultiBody *body() const { return body_; }

 private:
  // Two rows side by side. Vectors and matrices hold the same operations that Bullet's scalar ones do.
  typedef double Pair __attribute__((vector_size(16)));
  struct Vector {
    Pair x, y, z;
  };
  struct Spatial {
    Vector top, bottom;
  };
  struct Matrix {
    Vector row[3];
  };
  struct Link {
    Matrix rotation;         // from the parent's frame to this one's
    Vector offset;           // from the parent's centre of mass to this one's
    Spatial axis, inertia;   // of the joint; articulated inertia times it
    Pair inverse_inertia;    // of the joint
  };
  struct State;

  static Pair both(btScalar value) { return Pair{value, value}; }
  static Vector both(const btVector3 &v) { return Vector{both(v.x()), both(v.y()), both(v.z())}; }
  static Matrix both(const btMatrix3x3 &m) { return Matrix{{both(m[0]), both(m[1]), both(m[2])}}; }
  static Vector add(const Vector &a, const Vector &b) { return Vector{a.x + b.x, a.y + b.y, a.z + b.z}; }
  static Vector subtract(const Vector &a, const Vector &b) { return Vector{a.x - b.x, a.y - b.y, a.z - b.z}; }
  static Vector negative(const Vector &a) { return Vector{-a.x, -a.y, -a.z}; }
  static Vector scale(const Vector &a, Pair s) { return Vector{a.x * s, a.y * s, a.z * s}; }
  static Pair dot(const Vector &a, const Vector &b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
  static Vector cross(const Vector &a, const Vector &b) {
    return Vector{a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
  }
  static Vector apply(const Matrix &m, const Vector &v) { return Vector{dot(m.row[0], v), dot(m.row[1], v), dot(m.row[2], v)}; }
  static Vector apply_transpose(const Matrix &m, const Vector &v) {
    return Vector{m.row[0].x * v.x + m.row[1].x * v.y + m.row[2].x * v.z, m.row[0].y * v.x + m.row[1].y * v.y + m.row[2].y * v.z,
                  m.row[0].z * v.x + m.row[1].z * v.y + m.row[2].z * v.z};
  }

  void jacobian(int link, State &state);
  void towards_base(int link, State &state);
  void away_from_base(int link, State &state);
  void read_base(const btMultiBody &body);

  const btMultiBody *body_ = nullptr;
  std::vector<Link> links_;
  std::vector<Pair> velocities_;
  std::vector<Pair> joint_forces_;  // of each joint and pair of rows: along the joint, less what the links beyond bear
  Matrix base_rotation_;            // from the world
  Vector base_position_;
  // The inverse of the base's articulated inertia, in blocks.
  Matrix upper_left_, upper_right_, lower_left_, lower_right_;
};

}  // namespace bs

#endif
