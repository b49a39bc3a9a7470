//! Other moments of joints and of the clamp, and other forces of the air, than those of chain.rs.

/// Numbers that a joint can remember.
pub const MEMORY: usize = 25;
pub type Memory = [f64; MEMORY];

/// Curvatures over which a plateau is reached, and where the softer branch begins, 1/cm.
const PLATEAU_PER_CM: f64 = 0.03;
const CORNER_PER_CM: f64 = 0.012;
/// Curvature at which half of the loss of stiffness is reached, 1/cm, and the power with which it comes (Kraus).
const KRAUS_PER_CM: f64 = 0.015;
const KRAUS_POWER: f64 = 1.2;
/// Curvatures over which ceramics soften under tension and under compression, 1/cm.
const TENSION_PER_CM: f64 = 0.02;
const COMPRESSION_PER_CM: f64 = 0.06;
/// Angle over which friction builds up before it slides, rad (Dahl), and the largest such angle of the Jenkins elements.
const PRESLIDING: f64 = 0.002;
const JENKINS: usize = 6;
const LARGEST_SLIP: f64 = 0.006;
/// Deflection of the bristles from which they slide, rad, and the time of their damping, s (LuGre).
const BRISTLE: f64 = 0.001;
const BRISTLE_TIME: f64 = 0.001;
/// Angle over which contacts are renewed, rad, the age from which they gain strength, s, and their gain with the logarithm of the age.
const CONTACT: f64 = 0.001;
const CONTACT_AGE: f64 = 0.001;
const AGEING: f64 = 0.05;
/// Speeds over which friction turns, and over which its static excess vanishes, rad/s.
const TURN_SPEED: f64 = 0.06;
const STRIBECK_SPEED: f64 = 0.2;
const STATIC_EXCESS: f64 = 0.4;
/// Speed over which the loss in proportion to the amplitude turns, rad/s.
const REID_SPEED: f64 = 0.05;
const FRACTION: f64 = 0.2;
/// Time about which the relaxation times of a broad peak lie, s: 8 Hz; its order.
const BROAD_TIME: f64 = 0.02;
const BROAD_ORDER: f64 = 0.5;
/// Time of the one Maxwell element, s: 10 Hz.
const ZENER_TIME: f64 = 0.0159;
/// Time over which the frequency of the motion is taken, s, and the frequency, rad/s, of motions of less than an angle, rad.
const MEAN_TIME: f64 = 0.1;
const REST_FREQUENCY: f64 = 100.0;
const REST_ANGLE: f64 = 1e-4;
/// Time over which pads of a clamp give way, s.
const PAD_TIME: f64 = 0.05;
/// Softness of the play of a clamp at its middle.
const PLAY_SHARE: f64 = 0.9;
/// By how much a clamp is stiffer and softer than its mean towards either side.
const SIDE_SHARE: f64 = 0.5;

/// A law that adds to the linear moment of a joint.
#[derive(Clone, Copy)]
pub enum Moment {
    /// Stiffness falls in proportion to the strain: Leadenham and Erturk, Nonlinear Dyn. 79 (2015) 1727. The factor is in cm.
    SofteningByStrain(f64),
    /// Stiffness falls exponentially to a plateau; the share lost.
    SofteningToPlateau(f64),
    /// Stiffness is less by a share beyond a corner: a bilinear spring.
    SofteningAtCorner(f64),
    /// Stiffness falls between two plateaus as that of a filled polymer, here the bond: Kraus, J. Appl. Polym. Sci. Appl. Polym. Symp. 39 (1984) 75; the
    /// share lost.
    SofteningByKraus(f64),
    /// Ceramics soften under tension long before they do under compression (unlike deformation of PZT under either: Fett, Mueller, Munz and Thun, 1998), by an
    /// assumed course; the share lost.
    SofteningByTension(f64),
    /// Friction with a static excess: Stribeck's curve, regularised by a root (Armstrong-Helouvry, 1991). Moments in dyn cm from here.
    Stribeck(f64),
    /// Dahl's friction with presliding.
    Dahl(f64),
    /// Jenkins elements of equal stiffness in parallel: Iwan, J. Appl. Mech. 33 (1966) 893.
    Iwan(f64),
    /// Bristles with Stribeck's curve: Canudas de Wit, Olsson, Astrom and Lischinsky, IEEE Trans. Autom. Control 40 (1995) 419.
    LuGre(f64),
    /// Contacts that gain strength with their age until sliding renews them: Dieterich, J. Geophys. Res. 84 (1979) 2161; Ruina, ibid. 88 (1983) 10359.
    AgeingContacts(f64),
    /// A fractional derivative of order 0.2, by a dense ladder (Bagley and Torvik, J. Rheol. 27 (1983) 201); share of the stiffness at 1 rad/s.
    Fractional(f64),
    /// The standard linear solid: one Maxwell element; its share of the stiffness.
    Zener(f64),
    /// A broad peak of the loss, the fractional standard solid with Cole and Cole's relaxation times: Pritz, J. Sound Vib. 195 (1996) 103; share of the stiffness.
    BroadPeak(f64),
    /// A loss in proportion to the angle and against the motion: Reid, J. R. Aeronaut. Soc. 60 (1956) 283; share of the stiffness.
    Reid(f64),
    /// A damper in inverse proportion to the frequency of the motion: hysteretic damping (Bishop, The treatment of damping forces in vibration theory, 1955). The
    /// frequency at the time is assumed to be that of the recent mean squares; share of the stiffness.
    HystereticDamper(f64),
    /// The clamp has a damper; its time in s.
    ClampDamper(f64),
    /// The clamp hardens with the cube of its angle; the angle in rad at which the cube is as large as the linear part.
    ClampHardening(f64),
    /// The clamp has a smoothed play; its half width in rad.
    ClampPlay(f64),
    /// The jaws of the clamp give unlike to either side, a bilinear spring: Shaw and Holmes, J. Sound Vib. 90 (1983) 129; the angle in rad over which it turns.
    ClampOneSided(f64),
    /// The clamp has pads of rubber or plastic, stiffer against fast moments: a standard linear solid; the stiffness that relaxes over the lasting one.
    ClampPads(f64),
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

/// Time and weight of a branch of a broad peak: Cole and Cole's density over ln T.
fn broad_rung(index: usize) -> [f64; 2] {
    let [time, _] = rung(index);
    let (phase, ratio) = (std::f64::consts::PI * BROAD_ORDER, (time / BROAD_TIME).ln());
    let density = phase.sin() / (std::f64::consts::TAU * ((BROAD_ORDER * ratio).cosh() + phase.cos()));
    [time, 0.25 * 10f64.ln() * density]
}

/// Deflection at which bristles slide at a speed.
fn bristle_limit(speed: f64) -> f64 {
    BRISTLE * (1.0 + STATIC_EXCESS * (-(speed / STRIBECK_SPEED).powi(2)).exp())
}

fn jenkins_limit(index: usize) -> f64 {
    LARGEST_SLIP * (index + 1) as f64 / JENKINS as f64
}

impl Moment {
    pub fn remembers(&self) -> bool {
        matches!(
            self,
            Moment::Dahl(_)
                | Moment::Iwan(_)
                | Moment::LuGre(_)
                | Moment::Fractional(_)
                | Moment::Zener(_)
                | Moment::BroadPeak(_)
                | Moment::AgeingContacts(_)
                | Moment::HystereticDamper(_)
                | Moment::ClampPads(_)
        )
    }

    /// True if it turns so sharply that it needs short steps.
    pub fn is_sharp(&self) -> bool {
        matches!(
            self,
            Moment::Stribeck(_)
                | Moment::Dahl(_)
                | Moment::Iwan(_)
                | Moment::LuGre(_)
                | Moment::AgeingContacts(_)
                | Moment::Reid(_)
        )
    }

    /// The memory after a step, by the implicit Euler method.
    pub fn next(&self, before: &Memory, step: f64, speed: f64) -> Memory {
        let mut after = *before;
        match self {
            Moment::Dahl(_) => after[0] = (before[0] + step * speed) / (1.0 + step * speed.abs() / PRESLIDING),
            Moment::LuGre(_) => after[0] = (before[0] + step * speed) / (1.0 + step * speed.abs() / bristle_limit(speed)),
            Moment::Zener(_) => after[0] = (before[0] + step * speed) / (1.0 + step / ZENER_TIME),
            Moment::ClampPads(_) => after[0] = (before[0] + step * speed) / (1.0 + step / PAD_TIME),
            Moment::AgeingContacts(_) => after[0] = (before[0] + step) / (1.0 + step * speed.abs() / CONTACT),
            Moment::HystereticDamper(_) => {
                // The angle from its mean, and the mean squares of that and of the speed.
                let part = step / MEAN_TIME;
                after[0] = (before[0] + step * speed) / (1.0 + part);
                after[1] = (before[1] + part * after[0] * after[0]) / (1.0 + part);
                after[2] = (before[2] + part * speed * speed) / (1.0 + part);
            }
            Moment::Iwan(_) => {
                for (i, place) in after.iter_mut().enumerate().take(JENKINS) {
                    *place = (*place + step * speed).clamp(-jenkins_limit(i), jenkins_limit(i));
                }
            }
            Moment::Fractional(_) | Moment::BroadPeak(_) => {
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
            Moment::SofteningByStrain(_)
            | Moment::SofteningToPlateau(_)
            | Moment::SofteningAtCorner(_)
            | Moment::SofteningByKraus(_)
            | Moment::SofteningByTension(_) => self.softening(motion),
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
            Moment::ClampOneSided(angle) => {
                let (root, part) = (motion.bend.hypot(angle), SIDE_SHARE * motion.stiffness);
                Addition { moment: -part * (root - angle), stiffness: part * motion.bend / root, damping: 0.0 }
            }
            _ => motion.before.map_or(Addition::default(), |(before, step)| self.remembered(motion, before, step)),
        }
    }

    fn softening(&self, motion: &Motion) -> Addition {
        let curvature = motion.stretch.abs() / motion.pitch_cm;
        let lost = match *self {
            Moment::SofteningByStrain(factor_cm) => (factor_cm * curvature).min(0.45),
            Moment::SofteningToPlateau(share) => share * -(-curvature / PLATEAU_PER_CM).exp_m1(),
            Moment::SofteningByKraus(share) => {
                let part = (curvature / KRAUS_PER_CM).powf(KRAUS_POWER);
                share * part / (1.0 + part)
            }
            Moment::SofteningByTension(share) => {
                let range = if motion.stretch > 0.0 { TENSION_PER_CM } else { COMPRESSION_PER_CM };
                share * -(-(curvature / range).powi(2)).exp_m1()
            }
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
            Moment::LuGre(moment) => {
                let limit = bristle_limit(motion.speed);
                let slid = 1.0 + step * motion.speed.abs() / limit;
                let left = (1.0 - motion.speed.signum() * before[0] / limit).max(0.0);
                let bristles = after[0] + BRISTLE_TIME * (after[0] - before[0]) / step;
                against_speed(moment / BRISTLE * bristles, moment / BRISTLE * (step + BRISTLE_TIME) * left / (slid * slid))
            }
            Moment::Iwan(moment) => {
                let spring = moment / (0..JENKINS).map(jenkins_limit).sum::<f64>();
                let sticking = (0..JENKINS).filter(|i| after[*i].abs() < jenkins_limit(*i)).count();
                against_speed(spring * after[..JENKINS].iter().sum::<f64>(), spring * step * sticking as f64)
            }
            Moment::AgeingContacts(moment) => {
                // A stage of the integrator may begin below zero.
                let chord = moment * (1.0 + AGEING * (after[0].max(0.0) / CONTACT_AGE).ln_1p()) / motion.speed.hypot(TURN_SPEED);
                against_speed(chord * motion.speed, chord)
            }
            Moment::HystereticDamper(share) => {
                // As above.
                let [angle, rate] = [after[1], after[2]].map(|square| square.max(0.0).sqrt());
                let chord = motion.stiffness * share * angle.hypot(REST_ANGLE) / rate.hypot(REST_ANGLE * REST_FREQUENCY);
                against_speed(chord * motion.speed, chord)
            }
            Moment::Zener(share) | Moment::ClampPads(share) => {
                let time = if matches!(self, Moment::ClampPads(_)) { PAD_TIME } else { ZENER_TIME };
                let part = motion.stiffness * share;
                against_speed(part * after[0], part * step / (1.0 + step / time))
            }
            Moment::Fractional(share) | Moment::BroadPeak(share) => {
                let of = if matches!(self, Moment::BroadPeak(_)) { broad_rung } else { rung };
                let part = motion.stiffness * share;
                let (mut moment, mut damping) = (0.0, 0.0);
                for (i, place) in after.iter().enumerate() {
                    let [time, weight] = of(i);
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
/// Speed in cm/s of the Reynolds number 80, about the square of Abraham's constant 9.06.
const LAYER_SPEED: f64 = 6.0;
/// Speed in cm/s from which on things bend away.
const BENDING_SPEED: f64 = 300.0;
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
    /// A coefficient that falls with the Reynolds number as `(1 + const / sqrt(Re))^2`: Abraham, Phys. Fluids 13 (1970) 2194.
    Reynolds(f64),
    /// Loose ends (leads, tape, markers) bend away from the flow, so that their drag passes from the square of the speed to a lower power, here the speed itself;
    /// flexible plates come to powers of 4/3 and, if round, 2/3: Gosselin, de Langre and Machado-Almeida, J. Fluid Mech. 650 (2010) 319.
    Bending(f64),
}

impl Air {
    /// Drag over half the air's density and the width, at a normal speed in cm/s and an arc length in cm.
    pub fn drag(&self, speed: f64, arc_cm: f64) -> f64 {
        match *self {
            Air::Power(factor) => factor * speed * (speed.abs() * EQUAL_SPEED).sqrt(),
            Air::Fence(factor) if arc_cm >= FENCE_CM => factor * speed * speed.abs(),
            Air::Fence(_) => 0.0,
            Air::Mixed(factor) => factor * speed * (speed.abs() + EQUAL_SPEED),
            Air::Bending(factor) => factor * speed * speed.abs() / (1.0 + speed.abs() / BENDING_SPEED),
            Air::Reynolds(factor) => factor * speed * (speed.abs().sqrt() + LAYER_SPEED.sqrt()).powi(2),
        }
    }
}
