//! Tapes and cables at the sheet: a vertical force at a point of a body ([`Attachment`]).
//!
//! A step puts it as F* − s (u − u*), with the point's mean vertical velocity u. The spring has its value where the rates at the step's start lead the point in
//! the middle of the step, and its slope times h/2 for what u differs from them. Damper and friction are linearised about the newest u, with the tangent where
//! the point slides fast and goes on in its direction, otherwise with the secant; where there is friction the step is repeated until nothing changes, as for dry
//! friction of the joints ([`joint_extensions`](super::joint_extensions)). In the recursion s is an inertia of the point in z.

use wide::f64x2;

use super::floor::next;
use super::lanes::pair;
use super::place;
use super::quad::{Arms, Quad};
use super::recursion::ContactTerms;
use crate::model::{ATTACHMENT_RATE, Attachment, Robot};

/// Repetitions end when no friction changes by more than this fraction of its force.
const FRICTION_ENOUGH: f64 = 1e-3;
/// A point slides fast at this multiple of the speed at which friction has 76 % of its force.
const FAST: f64 = 3.0;

/// The points of one robot at which something is fixed.
#[derive(Debug, Clone)]
pub(super) struct Attachments {
    points: Vec<Point>,
}

#[derive(Debug, Clone)]
struct Point {
    law: Attachment,
    /// Tree level of its body, and the lane of its arm.
    level: usize,
    arm: usize,
    /// Where it lies between the body's reference point (0) and its far end (1).
    share: f64,
    /// Height in the middle of the step (cm), and vertical velocity at its start (cm/s).
    height: f64,
    start: f64,
    /// Mean vertical velocity in the last repetition or step (cm/s).
    speed: f64,
    /// True if that changed its sign in this step's repetitions.
    turned_back: bool,
    /// Slope s and constant part F* + s u* of damper and friction.
    put: [f64; 2],
    /// The whole force, as the body's arm has it: slope and constant part as impulses of a step, at its lever (cm).
    slope: f64,
    impulse: f64,
    lever: f64,
}

impl Attachments {
    /// `None` where nothing is fixed to the robot.
    pub(super) fn new(robot: &Robot, root: usize) -> Option<Self> {
        let point = |law: &Attachment| {
            let (body, along) = robot.body_at(law.position);
            let (quad, lane) = place(body, root);
            Point {
                law: *law,
                level: 2 * quad + lane / 2,
                arm: lane % 2,
                share: if body < root { 1.0 - along } else { along },
                height: 0.0,
                start: 0.0,
                speed: 0.0,
                turned_back: false,
                put: [0.0; 2],
                slope: 0.0,
                impulse: 0.0,
                lever: 0.0,
            }
        };
        let points: Vec<Point> = robot.extensions.attachments.iter().map(point).collect();
        (!points.is_empty()).then_some(Self { points })
    }

    pub(super) fn is_repeated(&self) -> bool {
        self.points.iter().any(|point| point.law.friction > 0.0)
    }

    /// Begins a step or a step of statics in the bodies' present directions, with the root's reference point at a height (cm).
    pub(super) fn begin(&mut self, quads: &[Quad], root_height: f64) {
        for point in &mut self.points {
            let mut height = f64x2::splat(root_height);
            for level in 0..point.level {
                height = next(height, pair(&quads[level / 2].across, level % 2)[1], level);
            }
            let (quad, lane) = (&quads[point.level / 2], 2 * (point.level % 2) + point.arm);
            let of = |lanes: &super::lanes::Lanes| lanes.lane(lane);
            let [x, z] = [0, 1].map(|k| point.share * of(&quad.across[k]));
            point.lever = x;
            point.height = height.to_array()[point.arm] + z;
            point.start = of(&quad.motion[2]) + of(&quad.motion[0]) * (x - of(&quad.half[0]));
            point.turned_back = false;
        }
    }

    /// Sets the forces of a step as impulses over `share` (s); `half` is half the step (s).
    pub(super) fn load(&mut self, half: f64, share: f64) {
        for point in &mut self.points {
            let [spring, stiffness] = point.law.spring(point.height);
            point.put = point.resisting();
            let [resisting, rest] = point.put;
            point.slope = share * (half * stiffness + resisting);
            point.impulse = share * (spring + half * stiffness * point.start + rest);
        }
    }

    /// Sets forces and stiffnesses of statics, in the stead of impulses.
    pub(super) fn load_at_rest(&mut self) {
        for point in &mut self.points {
            [point.impulse, point.slope] = point.law.spring(point.height);
        }
    }

    /// Takes the mean motions of a solution; true if the linearised friction agrees with the law there.
    pub(super) fn accept(&mut self, quads: &[Quad]) -> bool {
        let mut agrees = true;
        for point in &mut self.points {
            let (quad, lane) = (&quads[point.level / 2], 2 * (point.level % 2) + point.arm);
            let [turn, _, z] = quad.mean.map(|mean| mean.lane(lane));
            let speed = z + turn * point.lever;
            let ([slope, rest], [force, _]) = (point.put, point.law.resistance(point.height, speed));
            agrees &= (slope * speed - rest - force).abs() <= FRICTION_ENOUGH * point.law.friction;
            point.turned_back |= speed * point.speed < 0.0;
            point.speed = speed;
        }
        agrees
    }

    /// The contact terms of a solution with these forces beside them.
    pub(super) fn with<'a, C>(&'a self, contact: C) -> WithAttachments<'a, C> {
        WithAttachments { contact, points: &self.points }
    }

    /// Mean velocities as numbers for storing.
    pub(super) fn saved(&self) -> impl Iterator<Item = f64> + '_ {
        self.points.iter().map(|point| point.speed)
    }

    pub(super) fn restore(&mut self, saved: &[f64]) {
        self.points.iter_mut().zip(saved).for_each(|(point, speed)| point.speed = *speed);
    }
}

impl Point {
    /// Slope s and constant part F* + s u* of damper and friction about the newest u.
    fn resisting(&self) -> [f64; 2] {
        let [force, slope] = self.law.resistance(self.height, self.speed);
        let is_smooth = self.law.friction == 0.0 || (self.speed.abs() > FAST * ATTACHMENT_RATE && !self.turned_back);
        if is_smooth {
            [slope, slope * self.speed - force]
        } else {
            [if self.speed.abs() < 1e-6 * ATTACHMENT_RATE { slope } else { force / self.speed }, 0.0]
        }
    }
}

/// Contact terms with those of what is fixed to the sheet.
pub(super) struct WithAttachments<'a, C> {
    contact: C,
    points: &'a [Point],
}

impl<C: ContactTerms> ContactTerms for WithAttachments<'_, C> {
    fn take(&mut self, level: usize) -> Option<Arms> {
        let mut terms = self.contact.take(level);
        for point in self.points.iter().filter(|point| point.level == level) {
            let terms = terms.get_or_insert_default();
            let add = |to: &mut f64x2, by: f64| {
                let mut both = [0.0; 2];
                both[point.arm] = by;
                *to += f64x2::new(both);
            };
            let coupling = point.lever * point.slope;
            add(&mut terms.inertia[0], point.lever * coupling);
            add(&mut terms.inertia[2], coupling);
            add(&mut terms.inertia[5], point.slope);
            add(&mut terms.lower[1], coupling);
            add(&mut terms.force[0], point.lever * point.impulse);
            add(&mut terms.force[2], point.impulse);
        }
        terms
    }
}
