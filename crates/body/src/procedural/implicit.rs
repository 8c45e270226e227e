//! Signed-distance-like primitives and their smooth unions. Values are first-order distances
//! (`f / |grad f|`), negative inside, so that a few Newton steps land on the surface.

use glam::{Mat3, Vec3};

/// Value (metres, negative inside) and unit-like gradient.
pub type Sample = (f32, Vec3);

/// One cross-section of a [`Loft`]: a superellipse with its own front and back depth.
#[derive(Clone, Copy, Debug)]
pub struct Section {
    /// Position along the axis, metres.
    pub at: f32,
    /// Half width along the local x axis.
    pub width: f32,
    /// Half depth towards +z.
    pub front: f32,
    /// Half depth towards -z.
    pub back: f32,
    /// Centre offset along local x.
    pub x: f32,
    /// Centre offset along local z.
    pub z: f32,
}

impl Section {
    fn channels(&self) -> [f32; 5] {
        [self.width, self.front, self.back, self.x, self.z]
    }
}

/// A body part swept along a straight axis with smoothly varying superellipse sections.
#[derive(Clone, Debug)]
pub struct Loft {
    origin: Vec3,
    /// Columns: local x, axis, local z.
    frame: Mat3,
    sections: Vec<Section>,
    exponent: f32,
}

impl Loft {
    /// `axis` and `depth` need not be orthogonal or unit; `sections` ascend in `at`.
    pub fn new(origin: Vec3, axis: Vec3, depth: Vec3, sections: Vec<Section>, exponent: f32) -> Self {
        let y = axis.normalize();
        let z = (depth - y * depth.dot(y)).normalize();
        Self { origin, frame: Mat3::from_cols(y.cross(z), y, z), sections, exponent }
    }

    /// Cubic Hermite interpolation of the five channels and their derivatives along the axis.
    fn section(&self, at: f32) -> ([f32; 5], [f32; 5]) {
        let s = &self.sections;
        let last = s.len() - 1;
        if at <= s[0].at {
            return (s[0].channels(), [0.0; 5]);
        }
        if at >= s[last].at {
            return (s[last].channels(), [0.0; 5]);
        }
        let i = s.partition_point(|x| x.at <= at) - 1;
        let h = s[i + 1].at - s[i].at;
        let t = (at - s[i].at) / h;
        let (p, q) = (s[i].channels(), s[i + 1].channels());
        let before = if i > 0 { Some(&s[i - 1]) } else { None };
        let after = s.get(i + 2);
        let mut value = [0.0; 5];
        let mut slope = [0.0; 5];
        for c in 0..5 {
            let d = (q[c] - p[c]) / h;
            let m0 = before.map_or(d, |b| (q[c] - b.channels()[c]) / (s[i + 1].at - b.at)) * h;
            let m1 = after.map_or(d, |a| (a.channels()[c] - p[c]) / (a.at - s[i].at)) * h;
            let (a3, a2) = (2.0 * (p[c] - q[c]) + m0 + m1, 3.0 * (q[c] - p[c]) - 2.0 * m0 - m1);
            value[c] = ((a3 * t + a2) * t + m0) * t + p[c];
            slope[c] = ((3.0 * a3 * t + 2.0 * a2) * t + m0) / h;
        }
        (value, slope)
    }

    /// A sphere round the whole part.
    fn bound(&self) -> (Vec3, f32) {
        let ends = [&self.sections[0], &self.sections[self.sections.len() - 1]];
        let middle = 0.5 * (ends[0].at + ends[1].at);
        let reach = |s: &Section| (s.at - middle).hypot(s.width.max(s.front).max(s.back) + s.x.hypot(s.z));
        let radius = self.sections.iter().map(reach).fold(0.0, f32::max);
        (self.origin + self.frame.y_axis * middle, radius * 1.1)
    }

    fn sample(&self, p: Vec3) -> Sample {
        let local = self.frame.transpose() * (p - self.origin);
        let (first, last) = (self.sections[0].at, self.sections[self.sections.len() - 1].at);
        let at = local.y.clamp(first, last);
        let over = local.y - at;
        let ([w, f, b, cx, cz], [dw, df, db, dcx, dcz]) = self.section(at);
        let (x, z) = (local.x - cx, local.z - cz);
        let (depth, ddepth) = if z >= 0.0 { (f, df) } else { (b, db) };
        let n = self.exponent;
        let (u, v) = ((x / w).abs().max(1e-6), (z / depth).abs().max(1e-6));
        let (un, vn, rho) = if n == 2.0 {
            (u * u, v * v, (u * u + v * v).sqrt())
        } else {
            let (un, vn) = (u.powf(n), v.powf(n));
            (un, vn, (un + vn).powf(1.0 / n))
        };
        // d rho / d u = (u / rho)^(n - 1)
        let (ru, rv) = (un / u * rho / (un + vn), vn / v * rho / (un + vn));
        let gx = ru / w * x.signum();
        let gz = rv / depth * z.signum();
        // Exact on the surface (rho = 1); damped outside, where a steep taper would make the part seem near.
        let gy = (-gx * dcx - gz * dcz - ru * u / w * dw - rv * v / depth * ddepth) / rho.max(1.0);
        let gradient = Vec3::new(gx, gy, gz);
        let length = gradient.length();
        let (mut d, mut g) = ((rho - 1.0) / length, gradient / length);
        if over != 0.0 {
            let e = over.abs();
            let cap = Vec3::Y * over.signum();
            if d > 0.0 {
                let total = (d * d + e * e).sqrt();
                g = (g * d + cap * e) / total;
                d = total;
            } else if e > d {
                (d, g) = (e, cap);
            }
        }
        (d, self.frame * g)
    }
}

/// A round cone (capsule with two radii), or with `a = b` an ellipsoid, seen through a linear squash.
#[derive(Clone, Copy, Debug)]
pub struct Cone {
    a: Vec3,
    b: Vec3,
    radius_a: f32,
    radius_b: f32,
    squash: Mat3,
    largest: f32,
}

impl Cone {
    /// A round cone between two points.
    pub fn new(a: Vec3, radius_a: f32, b: Vec3, radius_b: f32) -> Self {
        Self { a, b, radius_a, radius_b, squash: Mat3::IDENTITY, largest: radius_a.max(radius_b) }
    }
    /// Divides the radii along `direction` by `factor`; the end points stay.
    pub fn thinner(mut self, direction: Vec3, factor: f32) -> Self {
        let n = direction.normalize();
        let outer = Mat3::from_cols(n * n.x, n * n.y, n * n.z);
        self.squash *= Mat3::IDENTITY + outer * (factor - 1.0);
        self
    }
    /// An ellipsoid with semi-axes along the columns of `axes` (orthonormal).
    pub fn ellipsoid(centre: Vec3, semi_axes: Vec3, axes: Mat3) -> Self {
        let scale = Mat3::from_diagonal(semi_axes.recip());
        Self {
            a: centre,
            b: centre,
            radius_a: 1.0,
            radius_b: 1.0,
            squash: axes * scale * axes.transpose(),
            largest: semi_axes.max_element(),
        }
    }

    /// A sphere round the whole part.
    fn bound(&self) -> (Vec3, f32) {
        ((self.a + self.b) * 0.5, 0.5 * self.a.distance(self.b) + self.largest)
    }

    fn sample(&self, p: Vec3) -> Sample {
        let axis = self.squash * (self.b - self.a);
        let q = self.squash * (p - self.a);
        let squared = axis.length_squared();
        let t = if squared > 1e-12 { (q.dot(axis) / squared).clamp(0.0, 1.0) } else { 0.0 };
        let away = q - axis * t;
        let length = away.length().max(1e-7);
        let mut gradient = away / length;
        if t > 0.0 && t < 1.0 {
            gradient -= axis * ((self.radius_b - self.radius_a) / squared);
        }
        let f = length - (self.radius_a + (self.radius_b - self.radius_a) * t);
        let gradient = self.squash.transpose() * gradient;
        let size = gradient.length().max(1e-6);
        (f / size, gradient / size)
    }
}

/// A primitive.
#[derive(Clone, Debug)]
pub enum Primitive {
    /// A swept part.
    Loft(Loft),
    /// A round cone or ellipsoid.
    Cone(Cone),
}

/// Primitives blended over `k` metres, optionally cut by half-spaces (`normal . p <= offset`) and hollowed.
#[derive(Clone, Debug)]
pub struct Group {
    k: f32,
    parts: Vec<Primitive>,
    hollows: Vec<Cone>,
    cuts: Vec<(Vec3, f32, f32)>,
    centre: Vec3,
    radius: f32,
}

/// A union of groups.
#[derive(Clone, Debug, Default)]
pub struct Implicit {
    /// Blend width between groups.
    pub k: f32,
    /// The groups.
    pub groups: Vec<Group>,
}

/// Blends end this many blend widths from the nearest part.
const CUTOFF: f32 = 8.0;

/// `-k log sum exp(-d / k)` accumulated without overflow.
struct SmoothMin {
    k: f32,
    least: f32,
    weight: f32,
    gradient: Vec3,
}

impl SmoothMin {
    fn new(k: f32) -> Self {
        Self { k, least: f32::INFINITY, weight: 0.0, gradient: Vec3::ZERO }
    }
    fn add(&mut self, (d, g): Sample) {
        if d < self.least {
            let scale = if self.least.is_finite() { ((d - self.least) / self.k).exp() } else { 0.0 };
            self.weight = self.weight * scale + 1.0;
            self.gradient = self.gradient * scale + g;
            self.least = d;
        } else if d - self.least < CUTOFF * self.k {
            let w = ((self.least - d) / self.k).exp();
            self.weight += w;
            self.gradient += g * w;
        }
    }
    fn result(&self) -> Sample {
        (self.least - self.k * self.weight.ln(), self.gradient / self.weight)
    }
}

fn smooth_max(a: Sample, b: Sample, k: f32) -> Sample {
    let mut m = SmoothMin::new(k);
    m.add((-a.0, -a.1));
    m.add((-b.0, -b.1));
    let (d, g) = m.result();
    (-d, -g)
}

impl Primitive {
    fn bound(&self) -> (Vec3, f32) {
        match self {
            Self::Loft(l) => l.bound(),
            Self::Cone(c) => c.bound(),
        }
    }
}

impl Group {
    /// Joins `parts`, blended over `k` metres.
    pub fn new(k: f32, parts: Vec<Primitive>) -> Self {
        let bounds: Vec<(Vec3, f32)> = parts.iter().map(Primitive::bound).collect();
        let centre = bounds.iter().map(|b| b.0).sum::<Vec3>() / bounds.len().max(1) as f32;
        let radius = bounds.iter().map(|b| b.0.distance(centre) + b.1).fold(0.0, f32::max);
        Self { k, parts, hollows: Vec::new(), cuts: Vec::new(), centre, radius }
    }
    /// Takes `hollows` away.
    pub fn without(mut self, hollows: Vec<Cone>) -> Self {
        self.hollows = hollows;
        self
    }
    /// Keeps the half-space `normal . p <= offset`, blended over `k` metres.
    pub fn cut(mut self, normal: Vec3, offset: f32, k: f32) -> Self {
        self.cuts.push((normal, offset, k));
        self
    }

    fn sample(&self, p: Vec3) -> Sample {
        let mut m = SmoothMin::new(self.k);
        for part in &self.parts {
            m.add(match part {
                Primitive::Loft(l) => l.sample(p),
                Primitive::Cone(c) => c.sample(p),
            });
        }
        let mut s = m.result();
        for hollow in &self.hollows {
            let (d, g) = hollow.sample(p);
            s = smooth_max(s, (-d, -g), 0.5 * self.k);
        }
        for &(normal, offset, k) in &self.cuts {
            s = smooth_max(s, (normal.dot(p) - offset, normal), k);
        }
        s
    }
}

impl Implicit {
    /// Value and gradient at `p`.
    pub fn sample(&self, p: Vec3) -> Sample {
        let mut m = SmoothMin::new(self.k);
        for group in &self.groups {
            // what lies farther than this adds less than a hundredth of a millimetre
            if p.distance(group.centre) - group.radius < m.least + CUTOFF * self.k {
                m.add(group.sample(p));
            }
        }
        m.result()
    }

    /// The nearby surface point, by `steps` damped Newton steps of at most 3 cm.
    pub fn project(&self, mut p: Vec3, steps: usize) -> Vec3 {
        for _ in 0..steps {
            let (d, g) = self.sample(p);
            p -= g * (d / g.length_squared().max(0.25)).clamp(-0.03, 0.03);
        }
        p
    }
}

/// The same primitives seen in the mirror `x -> -x`.
pub trait Mirrored {
    /// The mirror image.
    fn mirrored(&self) -> Self;
}

fn flip(v: Vec3) -> Vec3 {
    Vec3::new(-v.x, v.y, v.z)
}

impl Mirrored for Cone {
    fn mirrored(&self) -> Self {
        let m = Mat3::from_diagonal(Vec3::new(-1.0, 1.0, 1.0));
        Self { a: flip(self.a), b: flip(self.b), squash: m * self.squash * m, ..*self }
    }
}

impl Mirrored for Loft {
    fn mirrored(&self) -> Self {
        // Mirroring the frame makes it left-handed, which the sampling does not mind.
        let m = Mat3::from_diagonal(Vec3::new(-1.0, 1.0, 1.0));
        Self { origin: flip(self.origin), frame: m * self.frame, ..self.clone() }
    }
}

impl Mirrored for Primitive {
    fn mirrored(&self) -> Self {
        match self {
            Self::Loft(l) => Self::Loft(l.mirrored()),
            Self::Cone(c) => Self::Cone(c.mirrored()),
        }
    }
}

impl Mirrored for Group {
    fn mirrored(&self) -> Self {
        Self {
            k: self.k,
            parts: self.parts.iter().map(Mirrored::mirrored).collect(),
            hollows: self.hollows.iter().map(Mirrored::mirrored).collect(),
            cuts: self.cuts.iter().map(|&(n, d, k)| (flip(n), d, k)).collect(),
            centre: flip(self.centre),
            radius: self.radius,
        }
    }
}
