#include "chain.h"

#include <algorithm>

namespace bs {

namespace {

// What Bullet's articulated-body pass leaves behind for the solver is private to btMultiBody. An explicit instantiation may name
// private members; it hands out pointers to them.
template <class Name, typename Name::Member MEMBER>
struct Reveal {
  friend typename Name::Member member(Name) { return MEMBER; }
};
#define BS_REVEAL(NAME, TYPE, MEMBER)                \
  struct NAME {                                      \
    typedef TYPE btMultiBody::*Member;               \
    friend Member member(NAME);                      \
  };                                                 \
  template struct Reveal<NAME, &btMultiBody::MEMBER>

BS_REVEAL(RealBuffer, btAlignedObjectArray<btScalar>, m_realBuf);
BS_REVEAL(VectorBuffer, btAlignedObjectArray<btVector3>, m_vectorBuf);
BS_REVEAL(MatrixBuffer, btAlignedObjectArray<btMatrix3x3>, m_matrixBuf);
BS_REVEAL(TopLeft, btMatrix3x3, m_cachedInertiaTopLeft);
BS_REVEAL(TopRight, btMatrix3x3, m_cachedInertiaTopRight);
BS_REVEAL(LowerLeft, btMatrix3x3, m_cachedInertiaLowerLeft);
BS_REVEAL(LowerRight, btMatrix3x3, m_cachedInertiaLowerRight);
BS_REVEAL(InertiaValid, bool, m_cachedInertiaValid);

}  // namespace

// What one call of respond() works on.
struct Chain::State {
  Row *rows;
  int count, pairs;
  Vector point[MAX_ROWS / 2], normal[MAX_ROWS / 2];  // in the frame of the link at hand
  Spatial base_force[MAX_ROWS / 2], base_response[MAX_ROWS / 2];
  Spatial force[MAX_ROWS / 2], acceleration[MAX_ROWS / 2];
  Pair velocity[MAX_ROWS / 2], inverse_mass[MAX_ROWS / 2];

  Row &first(int pair) { return rows[2 * pair]; }
  // Of an odd number of rows the last is done twice.
  Row &second(int pair) { return rows[std::min(2 * pair + 1, count - 1)]; }
  Pair load(int pair, btScalar Row::*value) { return Pair{first(pair).*value, second(pair).*value}; }
  Vector load(int pair, btVector3 Row::*value) {
    const btVector3 &a = first(pair).*value, &b = second(pair).*value;
    return Vector{Pair{a.x(), b.x()}, Pair{a.y(), b.y()}, Pair{a.z(), b.z()}};
  }
  void store(int pair, btScalar *Row::*array, int index, Pair value) {
    (first(pair).*array)[index] = value[0];
    (second(pair).*array)[index] = value[1];
  }
  void store(int pair, btScalar *Row::*array, int index, const Vector &value) {
    store(pair, array, index, value.x);
    store(pair, array, index + 1, value.y);
    store(pair, array, index + 2, value.z);
  }
};

bool Chain::read(const btMultiBody &body) {
  body_ = nullptr;
  const int count = body.getNumLinks();
  if (count == 0 || body.getNumDofs() != count || body.isBaseStaticOrKinematic() || !(body.*member(InertiaValid()))) return false;
  const btAlignedObjectArray<btScalar> &reals = body.*member(RealBuffer());
  const btAlignedObjectArray<btVector3> &vectors = body.*member(VectorBuffer());
  const btAlignedObjectArray<btMatrix3x3> &matrices = body.*member(MatrixBuffer());
  links_.resize(static_cast<size_t>(count));
  for (int i = 0; i < count; ++i) {
    const btMultibodyLink &link = body.getLink(i);
    if (link.m_jointType != btMultibodyLink::eRevolute || link.m_parent != i - 1 || link.m_dofOffset != i ||
        body.isLinkAndAllAncestorsKinematic(i)) {
      return false;
    }
    Link &out = links_[static_cast<size_t>(i)];
    out.rotation = both(matrices[i + 1]);
    out.offset = both(link.m_cachedRVector);
    out.axis = Spatial{both(link.m_axes[0].m_topVec), both(link.m_axes[0].m_bottomVec)};
    out.inertia = Spatial{both(vectors[2 * i]), both(vectors[2 * i + 1])};
    // Each joint's block lies at the square of its offset; with one degree of freedom a block is one number.
    out.inverse_inertia = both(reals[6 + count + i * i]);
  }
  velocities_.clear();
  for (int i = 0; i < 6 + count; ++i) velocities_.push_back(both(reals[i]));
  joint_forces_.resize(static_cast<size_t>(count) * (MAX_ROWS / 2));
  base_rotation_ = both(matrices[0]);
  base_position_ = both(body.getBasePos());
  read_base(body);
  body_ = &body;
  return true;
}

// The inverse in blocks, as in btMultiBody::solveImatrix.
void Chain::read_base(const btMultiBody &body) {
  const btMatrix3x3 &top_left = body.*member(TopLeft()), &top_right = body.*member(TopRight());
  const btMatrix3x3 &lower_left = body.*member(LowerLeft()), &lower_right = body.*member(LowerRight());
  const btMatrix3x3 inverse = top_right.inverse() * btScalar(-1);
  const btMatrix3x3 upper_right = ((lower_right * inverse) * top_left + lower_left).inverse();
  const btMatrix3x3 upper_left = (upper_right * lower_right) * inverse;
  btMatrix3x3 rest = top_left * upper_left;
  for (int i = 0; i < 3; ++i) rest[i][i] -= 1.0;
  upper_left_ = both(upper_left);
  upper_right_ = both(upper_right);
  lower_left_ = both(inverse * rest);
  lower_right_ = both(upper_left.transpose());
}

void Chain::respond(int link, Row *rows, int count) {
  State state;
  state.rows = rows;
  state.count = count;
  state.pairs = (count + 1) / 2;
  jacobian(link, state);
  towards_base(link, state);
  away_from_base(link, state);
}

// The rows' Jacobians, the body's velocities along the rows, and the unit forces on the base in its own frame.
void Chain::jacobian(int link, State &state) {
  for (int pair = 0; pair < state.pairs; ++pair) {
    const Vector linear = state.load(pair, &Row::linear);
    const Vector arm = subtract(state.load(pair, &Row::point), base_position_);
    const Vector angular = add(cross(arm, linear), state.load(pair, &Row::angular));
    Pair velocity = state.load(pair, &Row::velocity);
    velocity += velocities_[0] * angular.x;
    velocity += velocities_[1] * angular.y;
    velocity += velocities_[2] * angular.z;
    velocity += velocities_[3] * linear.x;
    velocity += velocities_[4] * linear.y;
    velocity += velocities_[5] * linear.z;
    state.velocity[pair] = velocity;
    state.store(pair, &Row::jacobian, 0, angular);
    state.store(pair, &Row::jacobian, 3, linear);
    state.base_force[pair].top = apply(base_rotation_, negative(linear));
    state.base_force[pair].bottom = apply(base_rotation_, negative(angular));
    state.point[pair] = apply(base_rotation_, arm);
    state.normal[pair] = apply(base_rotation_, linear);
  }
  for (int i = 0; i <= link; ++i) {
    const Link &at = links_[static_cast<size_t>(i)];
    const Pair rate = velocities_[static_cast<size_t>(6 + i)];
    Pair *forces = &joint_forces_[static_cast<size_t>(i) * (MAX_ROWS / 2)];
    for (int pair = 0; pair < state.pairs; ++pair) {
      const Vector normal = apply(at.rotation, state.normal[pair]);
      const Vector point = subtract(apply(at.rotation, state.point[pair]), at.offset);
      const Pair value = dot(normal, add(cross(at.axis.top, point), at.axis.bottom));
      state.normal[pair] = normal;
      state.point[pair] = point;
      state.velocity[pair] += rate * value;
      state.store(pair, &Row::jacobian, 6 + i, value);
      forces[pair] = value;
    }
  }
  for (int i = link + 1; i < static_cast<int>(links_.size()); ++i) {
    for (int row = 0; row < state.count; ++row) state.rows[row].jacobian[6 + i] = 0;
  }
  for (int pair = 0; pair < state.pairs; ++pair) {
    state.first(pair).velocity = state.velocity[pair][0];
    state.second(pair).velocity = state.velocity[pair][1];
  }
}

// Carries the unit forces from the rows' link to the base.
void Chain::towards_base(int link, State &state) {
  for (int pair = 0; pair < state.pairs; ++pair) state.force[pair] = Spatial{};
  for (int i = link; i >= 0; --i) {
    const Link &at = links_[static_cast<size_t>(i)];
    Pair *forces = &joint_forces_[static_cast<size_t>(i) * (MAX_ROWS / 2)];
    for (int pair = 0; pair < state.pairs; ++pair) {
      const Spatial &force = state.force[pair];
      const Pair rest = forces[pair] - (dot(at.axis.bottom, force.top) + dot(at.axis.top, force.bottom));
      forces[pair] = rest;
      const Pair rate = at.inverse_inertia * rest;
      const Vector top = add(force.top, scale(at.inertia.top, rate));
      const Vector bottom = add(force.bottom, scale(at.inertia.bottom, rate));
      state.force[pair].top = apply_transpose(at.rotation, top);
      state.force[pair].bottom = apply_transpose(at.rotation, add(bottom, cross(at.offset, top)));
    }
  }
}

// The base's response, then the joints' from the base to the end.
void Chain::away_from_base(int link, State &state) {
  for (int pair = 0; pair < state.pairs; ++pair) {
    const Vector linear = add(state.base_force[pair].top, state.force[pair].top);
    const Vector angular = add(state.base_force[pair].bottom, state.force[pair].bottom);
    Spatial &response = state.acceleration[pair];
    response.top = negative(add(apply(upper_left_, linear), apply(upper_right_, angular)));
    response.bottom = negative(add(apply(lower_left_, linear), apply(lower_right_, angular)));
    const Vector turn = apply_transpose(base_rotation_, response.top), move = apply_transpose(base_rotation_, response.bottom);
    state.store(pair, &Row::response, 0, turn);
    state.store(pair, &Row::response, 3, move);
    const btScalar *a = state.first(pair).jacobian, *b = state.second(pair).jacobian;
    Pair sum = Pair{a[0], b[0]} * turn.x;
    sum += Pair{a[1], b[1]} * turn.y;
    sum += Pair{a[2], b[2]} * turn.z;
    sum += Pair{a[3], b[3]} * move.x;
    sum += Pair{a[4], b[4]} * move.y;
    sum += Pair{a[5], b[5]} * move.z;
    state.inverse_mass[pair] = sum;
  }
  for (int i = 0; i < static_cast<int>(links_.size()); ++i) {
    const Link &at = links_[static_cast<size_t>(i)];
    const Pair *forces = &joint_forces_[static_cast<size_t>(i) * (MAX_ROWS / 2)];
    for (int pair = 0; pair < state.pairs; ++pair) {
      Spatial &a = state.acceleration[pair];
      const Vector top = apply(at.rotation, a.top);
      const Vector bottom = add(negative(cross(at.offset, top)), apply(at.rotation, a.bottom));
      const Pair borne = dot(bottom, at.inertia.top) + dot(top, at.inertia.bottom);
      const Pair value = at.inverse_inertia * ((i <= link ? forces[pair] : Pair{}) - borne);
      a.top = add(top, scale(at.axis.top, value));
      a.bottom = add(bottom, scale(at.axis.bottom, value));
      state.store(pair, &Row::response, 6 + i, value);
      if (i <= link) state.inverse_mass[pair] += Pair{state.first(pair).jacobian[6 + i], state.second(pair).jacobian[6 + i]} * value;
    }
  }
  for (int pair = 0; pair < state.pairs; ++pair) {
    state.first(pair).inverse_mass = state.inverse_mass[pair][0];
    state.second(pair).inverse_mass = state.inverse_mass[pair][1];
  }
}

}  // namespace bs
