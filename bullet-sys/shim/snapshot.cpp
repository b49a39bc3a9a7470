// Snapshots. A world is captured into a State of plain values, which becomes doubles (snapshot_state.h). A restore reads and
// checks the whole State before it touches the world, so that a foreign or damaged snapshot leaves the world alone.
#include <utility>

#include "snapshot_state.h"

namespace {

using namespace bs::snapshot;

Tree capture(const btDbvt &from) {
  Tree tree;
  tree.path = from.m_opath;
  std::vector<const btDbvtNode *> waiting;
  if (from.m_root != nullptr) waiting.push_back(from.m_root);
  while (!waiting.empty()) {
    const btDbvtNode &node = *waiting.back();
    waiting.pop_back();
    const int object = node.isleaf() ? index_of(*static_cast<btDbvtProxy *>(node.data)) : -1;
    tree.nodes.push_back({object, node.volume.Mins(), node.volume.Maxs()});
    if (node.isinternal()) waiting.insert(waiting.end(), {node.childs[1], node.childs[0]});
  }
  return tree;
}

// Bullet's getters are not const throughout; nothing is changed here.
State capture(bs_world &world) {
  State state;
  state.gravity = world.dynamics.getGravity();
  for (const auto &from : world.bodies) {
    const btMultiBody &multibody = *from.multibody;
    Body body;
    body.position = multibody.getBasePos();
    body.rotation = multibody.getWorldToBaseRot();
    body.velocity = multibody.getBaseVel();
    body.omega = multibody.getBaseOmega();
    body.applied_force = multibody.getBaseForce();
    body.applied_torque = multibody.getBaseTorque();
    for (int i = 0; i < multibody.getNumLinks(); ++i) {
      const btMultibodyLink &link = multibody.getLink(i);
      body.joints.push_back({multibody.getJointPos(i), multibody.getJointVel(i), link.m_jointTorque[0],
                             link.m_appliedForce, link.m_appliedTorque, link.m_cachedRotParentToThis, link.m_cachedRVector, link.m_cachedWorldTransform});
    }
    state.bodies.push_back(std::move(body));
  }
  const btCollisionObjectArray &objects = world.dynamics.getCollisionObjectArray();
  for (int i = 0; i < objects.size(); ++i) {
    const btCollisionObject &object = *objects[i];
    const btBroadphaseProxy &proxy = *object.getBroadphaseHandle();
    state.objects.push_back({object.getWorldTransform(), object.getInterpolationWorldTransform(), object.getActivationState(),
                             object.getDeactivationTime(), proxy.m_aabbMin, proxy.m_aabbMax});
  }
  for (const auto &constraint : world.constraints) {
    state.impulses.emplace_back();
    for (int row = 0; row < constraint->getNumRows(); ++row) state.impulses.back().push_back(constraint->getAppliedImpulse(row));
  }
  const btDbvtBroadphase &broadphase = world.broadphase;
  state.stage = broadphase.m_stageCurrent;
  state.fixed_left = broadphase.m_fixedleft;
  state.new_pairs = broadphase.m_newpairs;
  state.parse_id = broadphase.m_pid;
  state.cleanup_index = broadphase.m_cid;
  state.needs_cleanup = broadphase.m_needcleanup;
  state.update_calls = broadphase.m_updates_call;
  state.updates_done = broadphase.m_updates_done;
  state.updates_ratio = broadphase.m_updates_ratio;
  for (size_t s = 0; s < state.stages.size(); ++s) {
    for (const btDbvtProxy *p = broadphase.m_stageRoots[s]; p != nullptr; p = p->links[1]) state.stages[s].push_back(index_of(*p));
  }
  for (size_t t = 0; t < state.trees.size(); ++t) state.trees[t] = capture(broadphase.m_sets[t]);
  const btBroadphasePairArray &pairs = world.pair_cache.getOverlappingPairArray();
  for (int i = 0; i < pairs.size(); ++i) {
    state.pairs.push_back({index_of(*pairs[i].m_pProxy0), index_of(*pairs[i].m_pProxy1), pairs[i].m_algorithm != nullptr});
  }
  for (int m = 0; m < world.dispatcher.getNumManifolds(); ++m) {
    const btPersistentManifold &from = *world.dispatcher.manifolds()[m];
    Manifold manifold;
    manifold.first = from.getBody0()->getWorldArrayIndex();
    manifold.second = from.getBody1()->getWorldArrayIndex();
    for (int p = 0; p < from.getNumContacts(); ++p) manifold.points.push_back(from.getContactPoint(p));
    state.manifolds.push_back(std::move(manifold));
  }
  return state;
}

bool is_compound(const btCollisionObject &object) { return object.getCollisionShape()->isCompound(); }
std::pair<int, int> unordered(int a, int b) { return std::minmax({a, b}); }

// Whether the indices of a State fit together and fit the world: all that `apply` relies upon.
void check(const State &state, bs_world &world) {
  const btCollisionObjectArray &objects = world.dynamics.getCollisionObjectArray();
  const size_t count = state.objects.size();
  std::vector<int> listed(count, -1), leaf(count, -1);
  for (size_t s = 0; s < state.stages.size(); ++s) {
    for (int object : state.stages[s]) {
      accept(std::exchange(listed[static_cast<size_t>(object)], int(s)) == -1, "the snapshot's broadphase lists an object twice");
    }
  }
  for (size_t t = 0; t < state.trees.size(); ++t) {
    const std::vector<Node> &nodes = state.trees[t].nodes;
    size_t open = nodes.empty() ? 0 : 1;
    for (const Node &node : nodes) {
      accept(open > 0, "the snapshot's broadphase tree has loose nodes");
      if (node.object < 0) {
        ++open;
      } else {
        --open;
        const int before = std::exchange(leaf[static_cast<size_t>(node.object)], int(t));
        accept(before == -1, "the snapshot's broadphase trees hold an object twice");
      }
    }
    accept(open == 0, "the snapshot's broadphase tree lacks nodes");
  }
  for (size_t i = 0; i < count; ++i) {
    accept(listed[i] >= 0 && leaf[i] == (listed[i] == btDbvtBroadphase::STAGECOUNT ? 1 : 0),
           "the snapshot's broadphase lists and trees disagree");
  }

  std::vector<std::pair<int, int>> with_algorithm, all, expected, found;
  for (const Pair &pair : state.pairs) {
    btCollisionObject &first = *objects[pair.first], &second = *objects[pair.second];
    accept(proxy_of(first).m_uniqueId < proxy_of(second).m_uniqueId, "the snapshot holds a pair of objects the wrong way round");
    const bool can_meet = world.pair_cache.needsBroadphaseCollision(&proxy_of(first), &proxy_of(second));
    accept(can_meet, "the snapshot holds a pair that cannot meet");
    all.emplace_back(pair.first, pair.second);
    if (pair.has_algorithm == 0) continue;
    accept(first.checkCollideWith(&second) && second.checkCollideWith(&first), "the snapshot holds a pair that cannot collide");
    with_algorithm.push_back(unordered(pair.first, pair.second));
    // A compound makes its manifold only where its child is near; two boxes have one as soon as they are a pair.
    if (!is_compound(first) && !is_compound(second)) expected.emplace_back(pair.first, pair.second);
  }
  std::sort(all.begin(), all.end());
  accept(std::adjacent_find(all.begin(), all.end()) == all.end(), "the snapshot holds a pair twice");
  std::sort(with_algorithm.begin(), with_algorithm.end());
  for (const Manifold &manifold : state.manifolds) {
    const bool compound = is_compound(*objects[manifold.first]);
    accept(!is_compound(*objects[manifold.second]), "the snapshot holds contacts the wrong way round");
    accept(std::binary_search(with_algorithm.begin(), with_algorithm.end(), unordered(manifold.first, manifold.second)),
           "the snapshot holds contacts of objects that are no pair");
    found.push_back(unordered(manifold.first, manifold.second));
    if (!compound) {
      const auto place = std::find(expected.begin(), expected.end(), std::make_pair(manifold.first, manifold.second));
      accept(place != expected.end(), "the snapshot holds contacts twice or the wrong way round");
      expected.erase(place);
    }
  }
  accept(expected.empty(), "the snapshot lacks contacts of a pair");
  std::sort(found.begin(), found.end());
  accept(std::adjacent_find(found.begin(), found.end()) == found.end(), "the snapshot holds contacts twice");
}

// Memory of a tree's nodes until the tree takes it over.
struct FreeNode {
  void operator()(btDbvtNode *node) const { btAlignedFree(node); }
};
using Nodes = std::vector<std::unique_ptr<btDbvtNode, FreeNode>>;

Nodes allocate(size_t count) {
  Nodes nodes(count);
  for (auto &node : nodes) {
    void *memory = btAlignedAlloc(sizeof(btDbvtNode), 16);
    if (memory == nullptr) throw std::bad_alloc();
    node.reset(new (memory) btDbvtNode());
  }
  return nodes;
}

void apply(const Tree &from, Nodes memory, btDbvt &tree, const btCollisionObjectArray &objects) {
  std::vector<btDbvtNode *> open;  // inner nodes that wait for a child
  open.reserve(from.nodes.size());  // before anything is torn down: nothing below can fail
  tree.clear();
  tree.m_opath = from.path;
  tree.m_leaves = static_cast<int>(from.nodes.size() + 1) / 2;
  for (size_t i = 0; i < from.nodes.size(); ++i) {
    const int object = from.nodes[i].object;
    btDbvtNode *out = memory[i].release();
    out->volume = btDbvtVolume::FromMM(from.nodes[i].minima, from.nodes[i].maxima);
    out->parent = open.empty() ? nullptr : open.back();
    out->childs[0] = out->childs[1] = nullptr;
    if (open.empty()) {
      tree.m_root = out;
    } else if (open.back()->childs[0] == nullptr) {
      open.back()->childs[0] = out;
    } else {
      open.back()->childs[1] = out;
      open.pop_back();
    }
    if (object < 0) {
      open.push_back(out);
    } else {
      out->data = &proxy_of(*objects[object]);
      proxy_of(*objects[object]).leaf = out;
    }
  }
}

void apply(const Body &body, btMultiBody &multibody) {
  multibody.setBasePos(body.position);
  multibody.setWorldToBaseRot(body.rotation);
  multibody.setBaseVel(body.velocity);
  multibody.setBaseOmega(body.omega);
  multibody.clearForcesAndTorques();
  multibody.addBaseForce(body.applied_force);
  multibody.addBaseTorque(body.applied_torque);
  for (int i = 0; i < multibody.getNumLinks(); ++i) {
    const Joint &joint = body.joints[static_cast<size_t>(i)];
    multibody.setJointPos(i, joint.angle);
    multibody.setJointVel(i, joint.rate);
    btMultibodyLink &link = multibody.getLink(i);
    link.m_jointTorque[0] = joint.torque;
    link.m_appliedForce = joint.applied_force;
    link.m_appliedTorque = joint.applied_torque;
    link.m_cachedRotParentToThis = joint.rotation;
    link.m_cachedRVector = joint.offset;
    link.m_cachedWorldTransform = joint.transform;
  }
}

// Makes the algorithm of a pair, and with it the manifold, or none where a compound has had none: its child makes one only if the
// other object overlaps it, so the other object is put into the child or well away from it. (A compound here has one child and
// meets no other compound.) The contacts found there and the transforms are overwritten later.
void make_algorithm(bs_world &world, btBroadphasePair &pair, bool has_manifold) {
  btCollisionObject *still = static_cast<btCollisionObject *>(pair.m_pProxy0->m_clientObject);
  btCollisionObject *moved = static_cast<btCollisionObject *>(pair.m_pProxy1->m_clientObject);
  if (!is_compound(*still)) std::swap(still, moved);
  btVector3 minima, maxima, moved_minima, moved_maxima, origin(0, 0, 0);
  still->getCollisionShape()->getAabb(btTransform::getIdentity(), minima, maxima);
  moved->getCollisionShape()->getAabb(btTransform::getIdentity(), moved_minima, moved_maxima);
  const bool compound = is_compound(*still);
  if (compound) origin = static_cast<const btCompoundShape &>(*still->getCollisionShape()).getChildTransform(0).getOrigin();
  if (!compound || !has_manifold) origin += 2 * (maxima - minima) + 2 * (moved_maxima - moved_minima);
  still->setWorldTransform(btTransform::getIdentity());
  moved->setWorldTransform(btTransform(btQuaternion(0, 0, 0, 1), origin));
  (*world.dispatcher.getNearCallback())(pair, world.dispatcher, world.dynamics.getDispatchInfo());
}

void apply_contacts(const State &state, bs_world &world) {
  const btCollisionObjectArray &objects = world.dynamics.getCollisionObjectArray();
  btBroadphasePairArray &pairs = world.pair_cache.getOverlappingPairArray();
  while (pairs.size() > 0) {
    const btBroadphasePair last = pairs[pairs.size() - 1];
    world.pair_cache.removeOverlappingPair(last.m_pProxy0, last.m_pProxy1, &world.dispatcher);
  }
  std::vector<std::pair<int, int>> touching;
  for (const Manifold &manifold : state.manifolds) touching.push_back(unordered(manifold.first, manifold.second));
  std::sort(touching.begin(), touching.end());
  for (const Pair &pair : state.pairs) {
    world.pair_cache.addOverlappingPair(&proxy_of(*objects[pair.first]), &proxy_of(*objects[pair.second]));
  }
  for (size_t i = 0; i < state.pairs.size(); ++i) {
    if (state.pairs[i].has_algorithm == 0) continue;
    const auto key = unordered(state.pairs[i].first, state.pairs[i].second);
    make_algorithm(world, pairs[static_cast<int>(i)], std::binary_search(touching.begin(), touching.end(), key));
  }

  auto &manifolds = world.dispatcher.manifolds();
  bool complete = static_cast<size_t>(manifolds.size()) == state.manifolds.size();
  for (int m = 0; complete && m < manifolds.size(); ++m) {
    const Manifold &from = state.manifolds[static_cast<size_t>(m)];
    auto is_from = [&](const btPersistentManifold &made) {
      return made.getBody0() == objects[from.first] && made.getBody1() == objects[from.second];
    };
    int at = m;
    while (at < manifolds.size() && !is_from(*manifolds[at])) ++at;
    complete = at < manifolds.size();
    if (!complete) break;
    manifolds.swap(m, at);
    btPersistentManifold &manifold = *manifolds[m];
    manifold.setNumContacts(static_cast<int>(from.points.size()));
    for (int p = 0; p < manifold.getNumContacts(); ++p) manifold.getContactPoint(p) = from.points[static_cast<size_t>(p)];
  }
  for (int m = 0; m < manifolds.size(); ++m) manifolds[m]->m_index1a = m;
  if (!complete) throw std::runtime_error("Bullet made other contact manifolds than the snapshot holds");
}

void apply(const State &state, bs_world &world) {
  const btCollisionObjectArray &objects = world.dynamics.getCollisionObjectArray();
  btDbvtBroadphase &broadphase = world.broadphase;
  Nodes memory[2] = {allocate(state.trees[0].nodes.size()), allocate(state.trees[1].nodes.size())};

  world.dynamics.setGravity(state.gravity);
  for (size_t b = 0; b < state.bodies.size(); ++b) apply(state.bodies[b], *world.bodies[b].multibody);
  for (size_t c = 0; c < state.impulses.size(); ++c) {
    int row = 0;
    for (double impulse : state.impulses[c]) world.constraints[c]->internalSetAppliedImpulse(row++, impulse);
  }
  // Two sleeping objects would get no algorithm.
  for (int i = 0; i < objects.size(); ++i) objects[i]->forceActivationState(ACTIVE_TAG);
  apply_contacts(state, world);
  for (int i = 0; i < objects.size(); ++i) {
    const Object &from = state.objects[static_cast<size_t>(i)];
    objects[i]->setWorldTransform(from.transform);
    objects[i]->setInterpolationWorldTransform(from.interpolation);
    objects[i]->forceActivationState(from.activation);
    objects[i]->setDeactivationTime(from.deactivation_time);
    proxy_of(*objects[i]).m_aabbMin = from.minima;
    proxy_of(*objects[i]).m_aabbMax = from.maxima;
  }
  broadphase.m_stageCurrent = state.stage;
  broadphase.m_fixedleft = state.fixed_left;
  broadphase.m_newpairs = state.new_pairs;
  broadphase.m_pid = state.parse_id;
  broadphase.m_cid = state.cleanup_index;
  broadphase.m_needcleanup = state.needs_cleanup != 0;
  broadphase.m_updates_call = state.update_calls;
  broadphase.m_updates_done = state.updates_done;
  broadphase.m_updates_ratio = state.updates_ratio;
  for (size_t s = 0; s < state.stages.size(); ++s) {
    btDbvtProxy *previous = nullptr;
    broadphase.m_stageRoots[s] = nullptr;
    for (int object : state.stages[s]) {
      btDbvtProxy &proxy = proxy_of(*objects[object]);
      proxy.stage = static_cast<int>(s);
      proxy.links[0] = previous;
      proxy.links[1] = nullptr;
      (previous != nullptr ? previous->links[1] : broadphase.m_stageRoots[s]) = &proxy;
      previous = &proxy;
    }
  }
  for (size_t t = 0; t < state.trees.size(); ++t) apply(state.trees[t], std::move(memory[t]), broadphase.m_sets[t], objects);
}

Fields fields_of(const bs_world *world) {
  State state = capture(const_cast<bs_world &>(*world));
  Fields fields;
  visit(fields, *world, state);
  bs::require(fields.written().size() <= static_cast<size_t>(std::numeric_limits<int32_t>::max()), "the snapshot is too long");
  return fields;
}

}  // namespace

extern "C" {

int32_t bs_snapshot_size(const bs_world *world, int32_t *size) {
  return bs::guarded(nullptr, 0, [&] {
    bs::require(world != nullptr && size != nullptr, "null pointer");
    *size = static_cast<int32_t>(fields_of(world).written().size());
  });
}

int32_t bs_snapshot_take(const bs_world *world, double *data, int32_t length, char *error, int32_t error_length) {
  return bs::guarded(error, error_length, [&] {
    bs::require(world != nullptr && data != nullptr, "null pointer");
    const Fields fields = fields_of(world);
    bs::require(length >= 0 && static_cast<size_t>(length) >= fields.written().size(), "the snapshot does not fit into the array");
    std::copy(fields.written().begin(), fields.written().end(), data);
  });
}

int32_t bs_snapshot_restore(bs_world *world, const double *data, int32_t length, char *error, int32_t error_length) {
  return bs::guarded(error, error_length, [&] {
    bs::require(world != nullptr && data != nullptr, "null pointer");
    bs::require(length >= 0, "a negative length");
    State state;
    Fields fields(data, static_cast<size_t>(length));
    visit(fields, *world, state);
    accept(fields.at_end(), "the snapshot is longer than it should be");
    check(state, *world);
    apply(state, *world);
  });
}

}  // extern "C"
