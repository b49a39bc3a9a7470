//! Other moments of joints and of the clamp, and other forces of the air, than those of chain.rs.

/// Numbers that a joint can remember.
pub const MEMORY: usize = 25;
pub type Memory = [f64; MEMORY];

/// Curvatures over which a plateau is reached, and where the softer branch begins, 1/cm.
const PLATEAU_PER_CM: f64 = 0.03;
const CORNER_PER_CM: f64 = 0.012;
/// Angle over which friction builds up before it slides, rad (Dahl), and the largest such angle of the Jenkins elements.
const PRESLIDING: f64 = 0.002;
const JENKINS: usize = 6;
const LARGEST_SLIP: f64 = 0.006;
/// Speeds over which friction turns, and over which its static excess vanishes, rad/s.
const TURN_SPEED: f64 = 0.06;
const STRIBECK_SPEED: f64 = 0.2;
const STATIC_EXCESS: f64 = 0.4;
/// Speed over which the loss in proportion to the amplitude turns, rad/s.
const REID_SPEED: f64 = 0.05;
const FRACTION: f64 = 0.2;
/// Time of the one Maxwell element, s: 10 Hz.
const ZENER_TIME: f64 = 0.0159;
/// Softness of the play of a clamp at its middle.
const PLAY_SHARE: f64 = 0.9;

/// A law that adds to the linear moment of a joint.
#[derive(Clone, Copy)]
pub enum Moment {
    /// Stiffness falls in proportion to the strain: Leadenham and Erturk, Nonlinear Dyn. 79 (2015) 1727. The factor is in cm.
    SofteningByStrain(f64),
    /// Stiffness falls exponentially to a plateau; the share lost.
    SofteningToPlateau(f64),
    /// Stiffness is less by a share beyond a corner: a bilinear spring.
    SofteningAtCorner(f64),
    /// Friction with a static excess: Stribeck's curve, regularised by a root (Armstrong-Helouvry, 1991). Moments in dyn cm from here.
    Stribeck(f64),
    /// Dahl's friction with presliding.
    Dahl(f64),
    /// Jenkins elements of equal stiffness in parallel: Iwan, J. Appl. Mech. 33 (1966) 893.
    Iwan(f64),
    /// A fractional derivative of order 0.2, by a dense ladder (Bagley and Torvik, J. Rheol. 27 (1983) 201); share of the stiffness at 1 rad/s.
    Fractional(f64),
    /// The standard linear solid: one Maxwell element; its share of the stiffness.
    Zener(f64),
    /// A loss in proportion to the angle and against the motion: Reid, J. R. Aeronaut. Soc. 60 (1956) 283; share of the stiffness.
    Reid(f64),
    /// The clamp has a damper; its time in s.
    ClampDamper(f64),
    /// The clamp hardens with the cube of its angle; the angle in rad at which the cube is as large as the linear part.
    ClampHardening(f64),
    /// The clamp has a smoothed play; its half width in rad.
    ClampPlay(f64),
}

/// What a joint does: angles in rad, speed in rad/s, stiffness in dyn cm/rad, and its memory before a step with the step's length.
pub struct Motion<'a> {
    pub stiffness: f64,
    pub pitch_cm: f64,
    pub stretch: f64,
    pub bend: f64,
    pub speed: f64,
    pub before: Option<(&'a Memory, f64)>,
}

/// What a law adds to the moment, and its slopes over angle and speed.
#[derive(Default)]
pub struct Addition {
    pub moment: f64,
    pub stiffness: f64,
    pub damping: f64,
}

fn against_speed(moment: f64, damping: f64) -> Addition {
    Addition { moment: -moment, stiffness: 0.0, damping }
}

/// Time and weight of a branch of the fractional derivative: `s^a = sin(pi a)/pi * integral of T^-a * sT/(1 + sT) over ln T`.
fn rung(index: usize) -> [f64; 2] {
    let time: f64 = 3e-5 * 10f64.powf(0.25 * index as f64);
    let pi = std::f64::consts::PI;
    [time, 0.25 * 10f64.ln() * (pi * FRACTION).sin() / pi * time.powf(-FRACTION)]
}

fn jenkins_limit(index: usize) -> f64 {
    LARGEST_SLIP * (index + 1) as f64 / JENKINS as f64
}

impl Moment {
    pub fn remembers(&self) -> bool {
        matches!(self, Moment::Dahl(_) | Moment::Iwan(_) | Moment::Fractional(_) | Moment::Zener(_))
    }

    /// True if it turns so sharply that it needs short steps.
    pub fn is_sharp(&self) -> bool {
        matches!(self, Moment::Stribeck(_) | Moment::Dahl(_) | Moment::Iwan(_) | Moment::Reid(_))
    }

    /// The memory after a step, by the implicit Euler method.
    pub fn next(&self, before: &Memory, step: f64, speed: f64) -> Memory {
        let mut after = *before;
        match self {
            Moment::Dahl(_) => after[0] = (before[0] + step * speed) / (1.0 + step * speed.abs() / PRESLIDING),
            Moment::Zener(_) => after[0] = (before[0] + step * speed) / (1.0 + step / ZENER_TIME),
            Moment::Iwan(_) => {
                for (i, place) in after.iter_mut().enumerate().take(JENKINS) {
                    *place = (*place + step * speed).clamp(-jenkins_limit(i), jenkins_limit(i));
                }
            }
            Moment::Fractional(_) => {
                for (i, place) in after.iter_mut().enumerate() {
                    *place = (*place + step * speed) / (1.0 + step / rung(i)[0]);
                }
            }
            _ => {}
        }
        after
    }

    /// What it adds to the moment of a joint.
    pub fn of(&self, motion: &Motion) -> Addition {
        match *self {
            Moment::SofteningByStrain(_) | Moment::SofteningToPlateau(_) | Moment::SofteningAtCorner(_) => self.softening(motion),
            Moment::Stribeck(moment) => {
                let speed = motion.speed;
                let excess = 1.0 + STATIC_EXCESS * (-(speed / STRIBECK_SPEED).powi(2)).exp();
                let chord = moment * excess / speed.hypot(TURN_SPEED);
                against_speed(chord * speed, chord)
            }
            Moment::Reid(share) => {
                let chord = motion.stiffness * share * motion.bend.abs() / motion.speed.hypot(REID_SPEED);
                against_speed(chord * motion.speed, chord)
            }
            Moment::ClampDamper(time) => against_speed(motion.stiffness * time * motion.speed, motion.stiffness * time),
            Moment::ClampHardening(angle) => {
                let part = motion.stiffness * (motion.bend / angle).powi(2);
                Addition { moment: -part * motion.bend, stiffness: 3.0 * part, damping: 0.0 }
            }
            Moment::ClampPlay(angle) => {
                let (tanh, part) = ((motion.bend / angle).tanh(), PLAY_SHARE * motion.stiffness);
                Addition { moment: part * angle * tanh, stiffness: -part * (1.0 - tanh * tanh), damping: 0.0 }
            }
            _ => motion.before.map_or(Addition::default(), |(before, step)| self.remembered(motion, before, step)),
        }
    }

    fn softening(&self, motion: &Motion) -> Addition {
        let curvature = motion.stretch.abs() / motion.pitch_cm;
        let lost = match *self {
            Moment::SofteningByStrain(factor_cm) => (factor_cm * curvature).min(0.45),
            Moment::SofteningToPlateau(share) => share * -(-curvature / PLATEAU_PER_CM).exp_m1(),
            Moment::SofteningAtCorner(share) => share * (1.0 - CORNER_PER_CM / curvature.max(CORNER_PER_CM)),
            _ => 0.0,
        };
        Addition { moment: motion.stiffness * lost * motion.stretch, stiffness: -motion.stiffness * lost, damping: 0.0 }
    }

    fn remembered(&self, motion: &Motion, before: &Memory, step: f64) -> Addition {
        let after = self.next(before, step, motion.speed);
        match *self {
            Moment::Dahl(moment) => {
                let slid = 1.0 + step * motion.speed.abs() / PRESLIDING;
                let left = (1.0 - motion.speed.signum() * before[0] / PRESLIDING).max(0.0);
                against_speed(moment * after[0] / PRESLIDING, moment / PRESLIDING * step * left / (slid * slid))
            }
            Moment::Iwan(moment) => {
                let spring = moment / (0..JENKINS).map(jenkins_limit).sum::<f64>();
                let sticking = (0..JENKINS).filter(|i| after[*i].abs() < jenkins_limit(*i)).count();
                against_speed(spring * after[..JENKINS].iter().sum::<f64>(), spring * step * sticking as f64)
            }
            Moment::Zener(share) => {
                let part = motion.stiffness * share;
                against_speed(part * after[0], part * step / (1.0 + step / ZENER_TIME))
            }
            Moment::Fractional(share) => {
                let part = motion.stiffness * share;
                let (mut moment, mut damping) = (0.0, 0.0);
                for (i, place) in after.iter().enumerate() {
                    let [time, weight] = rung(i);
                    moment += part * weight * place;
                    damping += part * weight * step / (1.0 + step / time);
                }
                against_speed(moment, damping)
            }
            _ => Addition::default(),
        }
    }
}

/// Speed in cm/s at which drag with another power is as large as the square law.
const EQUAL_SPEED: f64 = 100.0;
/// Arc length in cm beyond which a fence drags.
const FENCE_CM: f64 = 8.0;

/// A law of drag, with its coefficient.
#[derive(Clone, Copy)]
pub enum Air {
    /// Drag with the power 1.5 of the speed, as in a laminar boundary layer (Blasius); as large as the square law with the
    /// same coefficient at 100 cm/s.
    Power(f64),
    /// Drag of a fence near the tip only.
    Fence(f64),
    /// Linear and quadratic drag, which are equal at 100 cm/s.
    Mixed(f64),
}

impl Air {
    /// Drag over half the air's density and the width, at a normal speed in cm/s and an arc length in cm.
    pub fn drag(&self, speed: f64, arc_cm: f64) -> f64 {
        match *self {
            Air::Power(factor) => factor * speed * (speed.abs() * EQUAL_SPEED).sqrt(),
            Air::Fence(factor) if arc_cm >= FENCE_CM => factor * speed * speed.abs(),
            Air::Fence(_) => 0.0,
            Air::Mixed(factor) => factor * speed * (speed.abs() + EQUAL_SPEED),
        }
    }
}
