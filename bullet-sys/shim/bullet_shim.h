/* Thin C interface over Bullet's float64 Featherstone multibodies.
 *
 * Conventions, for every function below:
 *  - Units are the caller's; sfers uses CGS (cm, g, s, dyn). Frames are world frames, right-handed; quaternions are x, y, z, w.
 *  - Arrays travel as pointer and length; a length that does not match the object is refused with BS_ERROR_ARGUMENT.
 *  - Return value: BS_OK or one of the BS_ERROR_ codes. On an error the world is as it was, save where a function says otherwise.
 *  - `error`, `error_length`: buffer of the caller for a NUL-terminated message. Nullable.
 *  - Threads: a world may be used from any thread, by one at a time. Worlds share no mutable state. Of Bullet's globals one is
 *    written, once and under a lock, by the first world: gDbvtMargin = 0, as PyBullet does.
 *  - No C++ exception leaves these functions.
 */
#ifndef BULLET_SHIM_H
#define BULLET_SHIM_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* ---- identity ------------------------------------------------------------------------------------------------------ */

/* Raised whenever a signature, a structure or a constant of this header changes. */
#define BS_ABI_VERSION 5

#define BS_OK 0
#define BS_ERROR_ARGUMENT 1  /* a null pointer, a wrong length, an index out of range, a value that Bullet would assert on */
#define BS_ERROR_MEMORY 2    /* an allocation failed; the world must not be used further */
#define BS_ERROR_INTERNAL 3  /* an exception of another kind; the world must not be used further */
#define BS_ERROR_SNAPSHOT 4  /* a snapshot does not belong to a world of this make-up */

/* The BS_ABI_VERSION that the shim was compiled with. */
int32_t bs_abi_version(void);
/* sizeof(btScalar) of the headers the shim was compiled with: 8. */
int32_t bs_scalar_size(void);
/* Bullet's version number in the headers at compile time: 324 for 3.24. */
int32_t bs_bullet_version(void);
/* The precision of the *linked* library, asked of the library itself: 8 (double), 4 (single) or 0 (unknown). */
int32_t bs_linked_scalar_size(void);

/* Layout of the structures below as the C++ compiler sees it: sizeof(bs_settings), sizeof(bs_link), sizeof(bs_contact),
 * sizeof(bs_tree_body), and the offset of the last member of each. sizes: 8 values. */
void bs_layout(int32_t *sizes, int32_t length);

/* ---- world --------------------------------------------------------------------------------------------------------- */

typedef struct bs_world bs_world;

/* Solver settings. Every field is handed to the member of btContactSolverInfo, or to the call of Bullet, named beside it. */
typedef struct bs_settings {
  double gravity[3];                       /* setGravity (cm/s^2) */
  double erp2;                             /* m_erp2: share of a contact's penetration that a step removes */
  double friction_erp;                     /* m_frictionERP */
  double linear_slop;                      /* m_linearSlop (cm) */
  double warmstarting_factor;              /* m_warmstartingFactor */
  double least_squares_residual_threshold; /* m_leastSquaresResidualThreshold: iteration stops below it */
  double broadphase_velocity_prediction;   /* btDbvtBroadphase::setVelocityPrediction */
  int32_t solver_iterations;               /* m_numIterations */
  int32_t minimum_solver_batch_size;       /* m_minimumSolverBatchSize */
  int32_t force_update_all_aabbs;          /* setForceUpdateAllAabbs, 0 or 1 */
  int32_t reserved;                        /* 0 */
} bs_settings;

/* Creates an empty world. settings: copied. world: receives the handle; the caller frees it with bs_world_destroy. */
int32_t bs_world_create(const bs_settings *settings, bs_world **world, char *error, int32_t error_length);

/* Frees the world and all in it: constraints, then multibodies and colliders, then shapes. Nullable: world. */
void bs_world_destroy(bs_world *world);

/* Advances by `time_step` (s): Bullet's stepSimulation(time_step, 0), one step of just that length. Torques set before are used up. */
int32_t bs_world_step(bs_world *world, double time_step, char *error, int32_t error_length);

/* Sets the gravity (cm/s^2). gravity: 3 values. */
int32_t bs_world_set_gravity(bs_world *world, const double *gravity);

/* ---- multibody ----------------------------------------------------------------------------------------------------- */

/* One body of a tree: a box on a rigid body. The base is a bs_link too; it has no joint. */
typedef struct bs_link {
  double mass;                    /* (g) */
  double inertia[3];              /* about the centre of mass, along the box's axes (g cm^2); all 0: Bullet's own for the box */
  double half_extents[3];         /* of the collision box (cm) */
  double com_to_box[3];           /* from the centre of mass to the box's centre (cm), in this body's frame */
  double parent_com_to_joint[3];  /* from the parent's centre of mass to the joint (cm), in the parent's frame */
  double joint_to_com[3];         /* from the joint to this body's centre of mass (cm), in this body's frame */
  double axis[3];                 /* hinge axis, unit, in this body's frame */
  double friction;                /* lateral friction of the collider (-) */
  double restitution;             /* of the collider (-); a contact has the product of its two. Chains bounce with it exactly, other
                                   * bodies as Bullet has it, with the push out of the overlap on top */
  double collision_margin;        /* (cm) */
  int32_t parent;                 /* index of the parent link, -1 for the base */
  int32_t reserved;               /* 0 */
} bs_link;

/* Adds a multibody of boxes on hinges, at rest in its zero configuration with the base's centre of mass at `base_position`.
 * It never sleeps, its links do not collide with one another, its linear and angular damping are 0.
 * base: body without a joint. links: link_count entries, each after its parent. body: receives its index, counting from 0. */
int32_t bs_multibody_add(bs_world *world, const bs_link *base, const bs_link *links, int32_t link_count,
                         const double *base_position, int32_t *body, char *error, int32_t error_length);

/* Adds a static ground: a multibody without links, fixed, whose collider is a compound with one box.
 * half_extents: 3 values (cm). top: height (z, cm) of the origin, which lies at the centre of the box's upper face. */
int32_t bs_ground_add(bs_world *world, const double *half_extents, double top, double friction, double restitution,
                      double collision_margin, int32_t *body, char *error, int32_t error_length);

/* Ties the base of `body` to the world where it stands, with a 6-row constraint of at most `max_impulse` (dyn s) a row. */
int32_t bs_fixed_constraint_add(bs_world *world, int32_t body, double max_impulse, char *error, int32_t error_length);

/* The same with a tie that gives: the base may turn about its y axis, at `pivot` (3 values, cm, in the base's frame), by `compliance`
 * (rad/(dyn cm)) times the moment on it, with a damper of `damping_time` (s) times the spring's stiffness, and harder the more it turns:
 * the moment of a turn phi is phi (1 + (`hardening` phi)^2) / `compliance`, `hardening` in 1/rad. Both are implicit, so that no compliance
 * is too small for a step.
 * body: a chain, each link hanging on the one before it. */
int32_t bs_sprung_constraint_add(bs_world *world, int32_t body, const double *pivot, double compliance, double damping_time, double hardening,
                                 double max_impulse, char *error, int32_t error_length);

/* Points of a clamp's curve, the middle one at no moment. */
#define BS_CLAMP_POINTS 7

/* The same with a compliance that depends on the moment: `compliances` (BS_CLAMP_POINTS values, rad/(dyn cm), positive) at the multiples of
 * `width` (dyn cm) from -3 to 3, linear between them and constant beyond; the turn is the integral of the compliance over the moment. */
int32_t bs_bent_constraint_add(bs_world *world, int32_t body, const double *pivot, double width, const double *compliances, double damping_time,
                               double max_impulse, char *error, int32_t error_length);

/* Lets what ties a body also give in z, by `compliance` (cm/dyn) times the force on it, with a damper of `damping_time` (s) times the
 * spring's stiffness; implicit, too. The body must be tied. */
int32_t bs_constraint_shift_set(bs_world *world, int32_t body, double compliance, double damping_time, char *error, int32_t error_length);

/* Reads all joints at once. angles (rad), rates (rad/s): `length` values each, one per link. */
int32_t bs_joint_states(const bs_world *world, int32_t body, double *angles, double *rates, int32_t length);

/* Sets all joints at once, and the cached joint frames with them. The colliders keep their place until the next step. */
int32_t bs_joint_states_set(bs_world *world, int32_t body, const double *angles, const double *rates, int32_t length);

/* Sets the torque (dyn cm) on every joint for the coming step. torques: `length` values. */
int32_t bs_joint_torques_set(bs_world *world, int32_t body, const double *torques, int32_t length);

/* Adds forces for the coming step. forces: 6 values per body, the base first: force on the centre of mass (3, dyn) and torque (3, dyn cm),
 * in the world's axes. length: 6 times the number of bodies. */
int32_t bs_forces_add(bs_world *world, int32_t body, const double *forces, int32_t length);

/* Sets the lateral friction of all colliders of `body`, the base's first, and of the contact points that they have. frictions: `length`
 * values, one per body. Like the solver's settings they are not part of a snapshot. */
int32_t bs_frictions_set(bs_world *world, int32_t body, const double *frictions, int32_t length);

/* Base: centre of mass (cm), orientation (quaternion, base to world), velocity (cm/s) and angular velocity (rad/s).
 * state: 13 values. Current, unlike bs_link_states. */
int32_t bs_base_state(const bs_world *world, int32_t body, double *state, int32_t length);

/* Sets what bs_base_state reads. state: 13 values; the quaternion must be of unit length. */
int32_t bs_base_state_set(bs_world *world, int32_t body, const double *state, int32_t length);

/* Links, as cached by the last step (they lag one step behind the joints, as in PyBullet without computeForwardKinematics).
 * Each link takes 18 values: centre of mass (3, cm), rotation matrix link to world by rows (9), velocity of the centre of mass
 * (3, cm/s), angular velocity (3, rad/s). The velocities are of the current joint rates, turned by the cached rotation. */
int32_t bs_link_states(bs_world *world, int32_t body, double *states, int32_t length);

/* The velocity that Bullet clamps every generalised velocity of `body` to (btMultiBody::getMaxCoordinateVelocity), and the largest
 * magnitude of a generalised velocity now (cm/s or rad/s). Equal values mean that the clamp has bitten. */
int32_t bs_velocity_clamp(const bs_world *world, int32_t body, double *limit, double *largest);

/* Sets that velocity (btMultiBody::setMaxCoordinateVelocity; 100 in a new body). limit: positive. */
int32_t bs_velocity_clamp_set(bs_world *world, int32_t body, double limit);

/* ---- trees in frames ----------------------------------------------------------------------------------------------- */

/* What PyBullet's createMultiBody and loadURDF make, by the same operations in the same order. The states of a tree are set and read by the
 * functions above, too. */

#define BS_JOINT_REVOLUTE 0
#define BS_JOINT_FIXED 4

/* One body of a tree. Quaternions need not be of unit length. */
typedef struct bs_tree_body {
  double mass;                     /* (g); a base of mass 0 is fixed */
  double position[3];              /* of the frame (cm), in the parent's frame; of the base: in the world */
  double orientation[4];           /* of the frame */
  double inertial_position[3];     /* of the centre of mass (cm), in this frame */
  double inertial_orientation[4];  /* of the principal axes */
  double half_extents[3];          /* of the box (cm), with has_box */
  double box_position[3];          /* of the box's centre (cm), in this frame */
  double box_orientation[4];
  double axis[3];                  /* of a hinge, in this frame */
  double friction;                 /* lateral friction of the collider (-) */
  double collision_margin;         /* of the box (cm) */
  double compound_margin;          /* of what holds a box that is not at the centre of mass (cm) */
  int32_t parent;                  /* index of the parent link, -1 for the base */
  int32_t joint;                   /* BS_JOINT_ */
  int32_t has_box;                 /* 0 or 1 */
  int32_t reserved;                /* 0 */
} bs_tree_body;

/* Adds a tree, at rest in its zero configuration. bodies: `count` entries, the base first, the links depth first. It has Bullet's linear and
 * angular damping, and on every hinge a motor that holds its rate at 0 with at most `motor_impulse` (dyn cm s). */
int32_t bs_tree_add(bs_world *world, const bs_tree_body *bodies, int32_t count, double motor_impulse, int32_t *body, char *error,
                    int32_t error_length);

/* Ties the base of `body` to the world with a 6-row constraint: `pivot` and `frame` (quaternion) in the base's frame to `world_pivot` and
 * `world_frame`. */
int32_t bs_anchor_add(bs_world *world, int32_t body, const double *pivot, const double *frame, const double *world_pivot,
                      const double *world_frame, double max_impulse, char *error, int32_t error_length);

/* Sets the motor of a hinge: rate (rad/s), share of the difference that a step removes (-), largest impulse (dyn cm s), 0 for off. */
int32_t bs_motor_set(bs_world *world, int32_t body, int32_t link, double rate, double gain, double max_impulse);

/* Reads the impulses (dyn cm s) that the motors gave last, 0 on a fixed joint. impulses: `length` values, one per link. */
int32_t bs_motor_impulses(const bs_world *world, int32_t body, double *impulses, int32_t length);

/* Adds torques (dyn cm) on some joints to those for the coming step; those on fixed joints are left out. links, torques: `length` values. */
int32_t bs_joint_torques_add(bs_world *world, int32_t body, const int32_t *links, const double *torques, int32_t length);

/* Sets lateral, spinning and rolling friction of the collider of `link` (-1: base). frictions: 3 values (-, cm, cm); a negative one is left. */
int32_t bs_collider_frictions_set(bs_world *world, int32_t body, int32_t link, const double *frictions);

/* Sets linear and angular damping of the body (1/s). dampings: 2 values; a negative one is left. */
int32_t bs_dampings_set(bs_world *world, int32_t body, const double *dampings);

/* Sets the damping of a joint (dyn cm s). */
int32_t bs_joint_damping_set(bs_world *world, int32_t body, int32_t link, double damping);

/* bs_base_state with the quaternion by way of the matrix, as PyBullet reads it. */
int32_t bs_base_reading(const bs_world *world, int32_t body, double *state, int32_t length);

/* Links, as cached by the last step, 20 values each: centre of mass (3, cm), quaternion of the principal axes by way of the matrix (4), as in
 * bs_link_states velocity and angular velocity (6), 0 unless `with_velocities`; and the inertial frame in the link's frame, position (3, cm) and
 * quaternion (4). */
int32_t bs_link_readings(bs_world *world, int32_t body, int32_t with_velocities, double *states, int32_t length);

/* What PyBullet keeps in a file: state of the bodies, and contact points. A world that is resumed has its transforms, boxes and pairs anew.
 * The functions are like those of snapshots. */
int32_t bs_resume_size(const bs_world *world, int32_t *size);
int32_t bs_resume_take(const bs_world *world, double *data, int32_t length, char *error, int32_t error_length);
int32_t bs_resume_from(bs_world *world, const double *data, int32_t length, char *error, int32_t error_length);

/* ---- contacts ------------------------------------------------------------------------------------------------------ */

/* One contact point of the last step. link_a, link_b: -1 is the base. */
typedef struct bs_contact {
  double position_on_b[3];  /* (cm), world */
  double normal_on_b[3];    /* unit, from b towards a */
  double distance;          /* (cm), negative where the boxes overlap */
  double normal_impulse;    /* of the last step (dyn s), >= 0 */
  double friction_impulse[2];
  double friction_direction_1[3];
  double friction_direction_2[3];
  int32_t body_a;
  int32_t link_a;
  int32_t body_b;
  int32_t link_b;
} bs_contact;

/* Copies at most `capacity` contact points; count receives how many there are in all. contacts: Nullable when capacity is 0. */
int32_t bs_contacts(const bs_world *world, bs_contact *contacts, int32_t capacity, int32_t *count);

/* ---- snapshots ----------------------------------------------------------------------------------------------------- */

/* A snapshot holds everything that a later step depends on, as doubles (integers are exact in them): joint and base state, cached
 * transforms, broadphase trees, overlapping pairs and contact points with their impulses, each in Bullet's order. */

/* Number of doubles that a snapshot of the world takes now. */
int32_t bs_snapshot_size(const bs_world *world, int32_t *size);

/* Writes a snapshot. data: `length` values, at least bs_snapshot_size. */
int32_t bs_snapshot_take(const bs_world *world, double *data, int32_t length, char *error, int32_t error_length);

/* Puts the world back, so that it continues with the same bits. The world may be another one, built by the same calls.
 * Gravity and pending torques and forces come back too. length: exactly that of the snapshot. A snapshot of another make-up is refused before
 * anything changes; after BS_ERROR_MEMORY or BS_ERROR_INTERNAL destroy the world. */
int32_t bs_snapshot_restore(bs_world *world, const double *data, int32_t length, char *error, int32_t error_length);

#ifdef __cplusplus
}
#endif

#endif /* BULLET_SHIM_H */
