//! The one thing that PyBullet computes in single precision: where a link's frame stands, from its centre of mass.

use sfers::bullet::Pose;

type Vector = [f32; 3];
type Matrix = [Vector; 3];

/// Rotation and origin.
struct Transform {
    rotation: Matrix,
    origin: Vector,
}

fn transform(pose: &Pose) -> Transform {
    Transform { rotation: matrix(pose.orientation.map(|v| v as f32)), origin: pose.position.map(|v| v as f32) }
}

fn matrix([x, y, z, w]: [f32; 4]) -> Matrix {
    let s = 2.0 / (x * x + y * y + z * z + w * w);
    let (xs, ys, zs) = (x * s, y * s, z * s);
    let (wx, wy, wz) = (w * xs, w * ys, w * zs);
    let (xx, xy, xz) = (x * xs, x * ys, x * zs);
    let (yy, yz, zz) = (y * ys, y * zs, z * zs);
    [[1.0 - (yy + zz), xy - wz, xz + wy], [xy + wz, 1.0 - (xx + zz), yz - wx], [xz - wy, yz + wx, 1.0 - (xx + yy)]]
}

fn dot(a: &Vector, b: &Vector) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn column(m: &Matrix, j: usize) -> Vector {
    [m[0][j], m[1][j], m[2][j]]
}

fn quaternion(m: &Matrix) -> [f32; 4] {
    let trace = m[0][0] + m[1][1] + m[2][2];
    if trace > 0.0 {
        let root = (trace + 1.0).sqrt();
        let s = 0.5 / root;
        return [(m[2][1] - m[1][2]) * s, (m[0][2] - m[2][0]) * s, (m[1][0] - m[0][1]) * s, root * 0.5];
    }
    let i = if m[0][0] < m[1][1] {
        if m[1][1] < m[2][2] { 2 } else { 1 }
    } else if m[0][0] < m[2][2] {
        2
    } else {
        0
    };
    let (j, k) = ((i + 1) % 3, (i + 2) % 3);
    let root = (m[i][i] - m[j][j] - m[k][k] + 1.0).sqrt();
    let s = 0.5 / root;
    let mut q = [0.0; 4];
    q[i] = root * 0.5;
    q[3] = (m[k][j] - m[j][k]) * s;
    q[j] = (m[j][i] + m[i][j]) * s;
    q[k] = (m[k][i] + m[i][k]) * s;
    q
}

/// The link's frame in the world, from the inertial frame there and in the link's frame.
pub fn link_frame(inertial: &Pose, local: &Pose) -> Pose {
    let (world, local) = (transform(inertial), transform(local));
    let back = local.origin.map(|v| -v);
    // The inverse of the local frame: its rotation's transpose, and the origin turned by it.
    let origin: Vector = std::array::from_fn(|j| dot(&column(&local.rotation, j), &back));
    let position: Vector = std::array::from_fn(|i| dot(&world.rotation[i], &origin) + world.origin[i]);
    let rotation: Matrix = std::array::from_fn(|i| std::array::from_fn(|j| dot(&local.rotation[j], &world.rotation[i])));
    Pose { position: position.map(f64::from), orientation: quaternion(&rotation).map(f64::from) }
}
