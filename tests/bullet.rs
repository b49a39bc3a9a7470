//! The safe layer over Bullet: misuse is an error, and simple bodies move as mechanics says.

use sfers::bullet::{BaseState, BoxLink, BulletError, Ground, SolverSettings, World, Wrench};

fn cube(parent: Option<usize>) -> BoxLink {
    BoxLink {
        parent,
        mass: 2.0,
        inertia: None,
        half_extents: [0.5; 3],
        com_to_box: [0.0; 3],
        parent_com_to_joint: [0.5, 0.0, 0.0],
        joint_to_com: [0.5, 0.0, 0.0],
        axis: [0.0, 1.0, 0.0],
        friction: 0.5,
        restitution: 0.0,
        collision_margin: 0.001,
    }
}

fn world() -> World {
    World::new(&SolverSettings::pybullet(980.0)).unwrap()
}

fn ground(world: &mut World) {
    let floor =
        Ground { half_extents: [1000.0, 1000.0, 50.0], top: 0.0, friction: 1.0, restitution: 0.0, collision_margin: 0.001 };
    world.add_ground(&floor).unwrap();
}

#[test]
fn a_world_may_move_to_another_thread() {
    fn send<T: Send>(_: &T) {}
    let mut world = world();
    send(&world);
    let body = world.add_multibody(&cube(None), &[], [0.0; 3]).unwrap();
    std::thread::spawn(move || world.base_state(body).unwrap()).join().unwrap();
}

#[test]
fn bodies_that_cannot_be_are_refused_and_the_world_stays_usable() {
    let mut world = world();
    let none = [0.0; 3];
    for (base, links) in [
        (BoxLink { mass: -1.0, ..cube(None) }, vec![]),
        (BoxLink { half_extents: [0.0, 1.0, 1.0], ..cube(None) }, vec![]),
        (BoxLink { friction: f64::NAN, ..cube(None) }, vec![]),
        (cube(None), vec![BoxLink { axis: [0.0, 2.0, 0.0], ..cube(None) }]),
        (cube(None), vec![cube(Some(0))]),
        (BoxLink { restitution: 1.5, ..cube(None) }, vec![]),
        (BoxLink { inertia: Some([1.0, 0.0, 1.0]), ..cube(None) }, vec![]),
        (BoxLink { com_to_box: [f64::NAN, 0.0, 0.0], ..cube(None) }, vec![]),
        (cube(None), vec![cube(None), cube(Some(5))]),
    ] {
        assert!(world.add_multibody(&base, &links, none).is_err());
    }
    assert!(world.add_multibody(&cube(None), &[], [f64::NAN, 0.0, 0.0]).is_err());
    let body = world.add_multibody(&cube(None), &[cube(None)], none).unwrap();
    assert_eq!(world.joint_count(body), Ok(1));
    world.step(1e-3).unwrap();
}

#[test]
fn wrong_lengths_steps_and_foreign_bodies_are_errors() {
    let (mut world, mut other) = (world(), world());
    let body = world.add_multibody(&cube(None), &[cube(None)], [0.0; 3]).unwrap();
    let foreign = other.add_multibody(&cube(None), &[], [0.0; 3]).unwrap();
    assert_eq!(world.set_joint_torques(body, &[1.0, 2.0]), Err(BulletError::Length { what: "torques", found: 2, needed: 1 }));
    assert!(world.joint_states(body, &mut [0.0], &mut []).is_err());
    assert!(world.set_joint_states(body, &[f64::NAN], &[0.0]).is_err());
    assert_eq!(world.base_state(foreign), Err(BulletError::ForeignBody));
    assert!(world.add_fixed_constraint(body, 0.0).is_err());
    assert!(world.add_sprung_constraint(body, [0.0; 3], 0.0, 0.0, 0.0, 500.0).is_err());
    assert!(world.set_constraint_shift(body, 0.0, 0.0).is_err());
    assert!(world.set_constraint_shift(body, 1e-7, -1.0).is_err());
    assert!(world.add_sprung_constraint(body, [0.0; 3], 1e-7, -1.0, 0.0, 500.0).is_err());
    assert!(world.add_sprung_constraint(body, [0.0; 3], 1e-7, 0.0, -1.0, 500.0).is_err());
    assert!(world.add_sprung_constraint(body, [f64::NAN; 3], 1e-7, 0.0, 0.0, 500.0).is_err());
    assert!(world.add_bent_constraint(body, [0.0; 3], 0.0, [1e-7; 7], 0.0, 500.0).is_err());
    assert!(world.add_bent_constraint(body, [0.0; 3], 1e4, [0.0; 7], 0.0, 500.0).is_err());
    assert!(world.add_bent_constraint(body, [0.0; 3], 1e4, [1e-7; 7], f64::NAN, 500.0).is_err());
    assert!(matches!(other.add_sprung_constraint(foreign, [0.0; 3], 1e-7, 0.0, 0.0, 500.0), Err(BulletError::Refused(_))));
    assert_eq!(world.add_forces(body, &[Wrench::default()]), Err(BulletError::Length { what: "forces", found: 1, needed: 2 }));
    assert!(world.add_forces(body, &[Wrench { force: [f64::NAN; 3], torque: [0.0; 3] }; 2]).is_err());
    assert_eq!(world.set_frictions(body, &[1.0; 3]), Err(BulletError::Length { what: "frictions", found: 3, needed: 2 }));
    assert!(world.set_frictions(body, &[1.0, -1.0]).is_err());
    assert_eq!(world.set_frictions(foreign, &[1.0]), Err(BulletError::ForeignBody));
    for step in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(world.step(step), Err(BulletError::Value { .. })), "{step}");
    }
    let turned =
        BaseState { position: [0.0; 3], orientation: [0.0, 0.0, 0.0, 2.0], velocity: [0.0; 3], angular_velocity: [0.0; 3] };
    assert!(matches!(world.set_base_state(body, &turned), Err(BulletError::Refused(_))));
    assert!(World::new(&SolverSettings { solver_iterations: 0, ..SolverSettings::pybullet(980.0) }).is_err());
    assert!(World::new(&SolverSettings { erp2: -0.1, ..SolverSettings::pybullet(980.0) }).is_err());
}

#[test]
fn a_state_that_is_set_is_read_back() {
    let mut world = world();
    let body = world.add_multibody(&cube(None), &[cube(None), cube(Some(0))], [1.0, 2.0, 3.0]).unwrap();
    world.set_joint_states(body, &[0.1, -0.2], &[3.0, 4.0]).unwrap();
    let state = BaseState {
        position: [4.0, 5.0, 6.0],
        orientation: [0.0, 0.6, 0.0, 0.8],
        velocity: [7.0, 8.0, 9.0],
        angular_velocity: [0.1, 0.2, 0.3],
    };
    world.set_base_state(body, &state).unwrap();
    let (mut angles, mut rates) = ([0.0; 2], [0.0; 2]);
    world.joint_states(body, &mut angles, &mut rates).unwrap();
    assert_eq!((angles, rates), ([0.1, -0.2], [3.0, 4.0]));
    assert_eq!(world.base_state(body).unwrap(), state);
}

#[test]
fn the_floor_carries_the_weight() {
    let mut world = world();
    let body = world.add_multibody(&cube(None), &[], [0.0, 0.0, 0.5]).unwrap();
    ground(&mut world);
    let step = 1e-4;
    for _ in 0..2000 {
        world.step(step).unwrap();
    }
    let mut contacts = Vec::new();
    world.contacts(&mut contacts).unwrap();
    assert_eq!(contacts.len(), 4);
    // Two grams: the impulses of a step add up to m g h. Residual seen: 8e-10; the solver stops at its threshold.
    let impulse: f64 = contacts.iter().map(|contact| contact.normal_impulse).sum();
    assert!((impulse / (2.0 * 980.0 * step) - 1.0).abs() < 1e-6, "{impulse}");
    for contact in &contacts {
        assert!(contact.a.0 == body || contact.b.0 == body);
        assert!((contact.normal[2].abs() - 1.0).abs() < 1e-12);
    }
}

#[test]
fn the_velocity_clamp_is_seen_when_it_bites() {
    let mut world = world();
    let body = world.add_multibody(&cube(None), &[], [0.0; 3]).unwrap();
    // 980 cm/s² for 0.1 s is 98 cm/s, for 0.11 s it would be 108.
    for _ in 0..100 {
        world.step(1e-3).unwrap();
    }
    assert!(!world.velocity_clamp(body).unwrap().hit());
    for _ in 0..10 {
        world.step(1e-3).unwrap();
    }
    let clamp = world.velocity_clamp(body).unwrap();
    assert!(clamp.hit());
    assert_eq!((clamp.limit, clamp.largest), (100.0, 100.0));
}

#[test]
fn a_torque_acts_for_one_step_only() {
    let mut world = world();
    world.set_gravity([0.0; 3]).unwrap();
    let body = world.add_multibody(&cube(None), &[cube(None)], [0.0; 3]).unwrap();
    let (mut angles, mut rates) = ([0.0], [0.0]);
    world.set_joint_torques(body, &[1000.0]).unwrap();
    world.step(1e-3).unwrap();
    world.joint_states(body, &mut angles, &mut rates).unwrap();
    let first = rates[0];
    assert!(first > 0.0);
    world.step(1e-3).unwrap();
    world.joint_states(body, &mut angles, &mut rates).unwrap();
    // No torque, no gravity: the rate changes only by the centrifugal terms, of second order in the rate times the step.
    assert!((rates[0] - first).abs() < first * first * 1e-3, "{first} {}", rates[0]);
}

#[test]
fn a_snapshot_of_another_make_up_or_cut_short_is_refused() {
    let mut one = world();
    one.add_multibody(&cube(None), &[cube(None)], [0.0; 3]).unwrap();
    let mut two = world();
    two.add_multibody(&cube(None), &[], [0.0; 3]).unwrap();
    let snapshot = one.snapshot().unwrap();
    assert!(matches!(two.restore(&snapshot), Err(BulletError::Snapshot(_))));
    let mut cut = snapshot.as_slice().to_vec();
    cut.pop();
    assert!(matches!(one.restore(&sfers::bullet::Snapshot::from_vec(cut)), Err(BulletError::Snapshot(_))));
    one.restore(&snapshot).unwrap();
}
