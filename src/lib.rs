//! Planar piezoelectric soft robots, simulated as chains of motor-link units on Bullet.
//!
//! # The way of the data
//!
//! [`model`] turns a laminate's layers into a beam and the beam into a chain of links and hinges; [`drive`] gives every actuator a voltage
//! in time; [`actuator`] turns angle, rate and voltage of a joint into its torque; an [`engine`] steps the chain; an
//! [`experiment`] runs the loop and fills a [`recording`], from which measures are taken. [`sweep`] does so over a grid of values; [`view`] draws; [`effects`] extend the model where they act, and [`diagnose`] finds which of them measured data ask for; [`export`] writes the robots for other simulators; [`reproduce`] puts
//! the paper's results beside ours. [`crosscheck`] compares a recording with the
//! published simulator's, number by number. [`bullet`] is the safe layer over the physics library, [`analytic`] holds closed forms.
//!
//! # Units and frame
//!
//! Inside, everything is CGS: cm, g, s, dyn, rad, V. At the edges (experiment files, CSV, JSON) the unit stands in the name. Some constants
//! of Bullet are plain numbers whose meaning changes with the unit, and equal bits need equal arithmetic, so this is the reference's choice.
//!
//! The chain lies along +x from its left end, z points up, joints turn about +y. A positive joint angle lowers the far end. A negative
//! voltage gives positive rest angles: it bends the free end of a clamped robot down.
//!
//! # The model
//!
//! An actuator of length L and width w is m motor-link units. Each joint is a hinge with the torque
//!
//! ```text
//! τ = −k (θ − θ_V + η dθ/dt)                                     (1)
//! k = w·EI / (2 l),      l = L / (2 m)                           (2, 3)
//! θ_V = −β V / m                                                 (4)
//! β = γ L,      γ = (d/pitch) · z_p E_p h_p / EI                 (5)
//! ```
//!
//! * θ (rad), dθ/dt (rad/s): angle and rate of the joint; V (V): voltage on the actuator
//! * EI (dyn·cm²/cm): flexural rigidity of the laminate per unit width; see [`model::Laminate`]
//! * γ (1/(cm·V)): curvature per volt; β (rad/V): rotation per volt between the ends of an actuator
//! * d (cm/V): charge constant d33 (1 + ν); pitch (cm): distance of the electrodes; z_p, E_p, h_p: height above the neutral axis, modulus
//!   and thickness of the piezo layer
//! * η (s): damping time. The reference's `dampingEta` is 2π · (1 Hz) times it: read literally, the paper's "0.03 s" would overdamp the
//!   cantilever, so the paper's number is `dampingEta`
//!
//! A mode of frequency f then has the damping ratio ζ = π η f. The chain differs from the continuous beam by a term of order 1/m² (its
//! static sag by −1/(2m²), its first frequency by about +0.23/m²); the tip under slow voltage is right for every m.
//!
//! The actuator's mass is spread evenly. N actuators make N·m + 1 boxes, the first and last half as long and heavy as the others, so that a
//! joint stands in the middle of the piece that bends in it. Collision boxes are 0.1 cm thick, which sets contact and inertia.
//!
//! # One step
//!
//! In the reference's order, which decides the last bits (see [`experiment::run`]): the voltages are those of the previous step's time (0 for
//! the first two steps); time = step · dt; joints are read and torques computed; the state before the step is recorded if its
//! turn has come; the torques act and the world steps. The step is semi-implicit Euler with the torque of its beginning, so it
//! must stay below [`analytic::stable_step`].
//!
//! # What to expect
//!
//! Joint angles, rates and torques equal the published simulator's bit for bit on x86-64 with Debian 12's Bullet 3.24. The reference's own
//! step of 8.3·10⁻⁸ s is far finer than needed: at 10⁻⁵ s jump heights change by less than 0.1 mm. Contact in Bullet can create
//! energy.
//!
//! # References
//!
//! Z. Zheng et al., "Scalable Simulation and Demonstration of Jumping Piezoelectric 2-D Soft Robots", ICRA 2022,
//! doi:10.1109/ICRA46639.2022.9811927, arXiv 2202.13521, and the published code `sfers`.

// Some private items have their only user in a feature.
#![cfg_attr(not(all(feature = "bullet", feature = "cli", feature = "view")), allow(dead_code, unused_imports))]

pub mod actuator;
pub mod analytic;
#[cfg(feature = "bullet")]
pub mod bullet;
#[cfg(feature = "cli")]
pub mod cli;
pub mod crosscheck;
mod date;
pub mod diagnose;
pub mod drive;
pub mod effects;
pub mod engine;
pub mod experiment;
pub mod export;
mod files;
pub mod keys;
pub mod model;
pub mod number;
pub mod recording;
#[cfg(all(feature = "bullet", feature = "view"))]
pub mod reproduce;
pub mod simulation;
pub mod sweep;
#[cfg(feature = "view")]
pub mod view;
mod words;
mod xml;

/// Compiles and runs the examples of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
