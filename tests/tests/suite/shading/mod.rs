//! The reflection model in f64, from its usual form: the distribution with its
//! difference of squares, masking by tangents, and integrals as sums.

use std::f64::consts::{PI, TAU};

use etalon::Format;
use etalon::effects::geometry::View;
use etalon::effects::lighting::{LightKind, PunctualLight};
use etalon::image::ImageData;
use etalon::resource::TextureDesc;
use glam::{DMat3, DVec3};

/// Kernels take no surface to be smoother.
pub(crate) const LEAST_ROUGHNESS: f64 = 0.045;

/// A point of a surface, in view space.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Point {
    pub(crate) place: DVec3,
    pub(crate) normal: DVec3,
    pub(crate) colour: DVec3,
    pub(crate) mirrored: DVec3,
    pub(crate) roughness: f64,
}

/// Two parts of light: what is scattered, and what is mirrored.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Parts {
    pub(crate) scattered: DVec3,
    pub(crate) mirrored: DVec3,
}

impl Parts {
    pub(crate) fn sum(self) -> DVec3 {
        self.scattered + self.mirrored
    }

    pub(crate) fn plus(self, other: Self) -> Self {
        Self {
            scattered: self.scattered + other.scattered,
            mirrored: self.mirrored + other.mirrored,
        }
    }
}

/// Where a light is seen from a point, and its irradiance there.
fn arriving(light: &PunctualLight, view: &View, place: DVec3) -> (DVec3, DVec3) {
    let shines = view.view.transform_vector3(light.direction).normalize();
    let way = view.view.transform_point3(light.position) - place;
    let power = light.power.as_dvec3();
    let (towards, irradiance) = match light.kind {
        LightKind::Directional => return (-shines, power),
        LightKind::Point => (way.normalize(), power / way.length_squared()),
        LightKind::Spot { inner, outer } => {
            let (inner, outer) = (f64::from(inner).cos(), f64::from(outer).cos());
            let cosine = shines.dot(-way.normalize());
            let part = ((cosine - outer) / (inner - outer)).clamp(0.0, 1.0);
            (way.normalize(), power * part * part / way.length_squared())
        }
    };
    let window = light.reach.map_or(1.0, |reach| {
        (1.0 - (way.length() / f64::from(reach)).powi(4)).clamp(0.0, 1.0)
    });
    (towards, irradiance * window)
}

fn lambda(cosine: f64, a2: f64) -> f64 {
    let tangent2 = (1.0 - cosine * cosine) / (cosine * cosine);
    0.5 * ((1.0 + a2 * tangent2).sqrt() - 1.0)
}

impl Point {
    pub(crate) fn to_eye(self) -> DVec3 {
        -self.place.normalize()
    }

    /// The cosine of view. Interpolated normals that turn away from the eye count as
    /// turned to it.
    fn nv(&self) -> f64 {
        self.normal.dot(self.to_eye()).abs().max(1e-4)
    }

    fn roughness(&self) -> f64 {
        self.roughness.max(LEAST_ROUGHNESS)
    }

    /// What it sends to the eye of a light.
    pub(crate) fn lit(&self, light: &PunctualLight, view: &View) -> Parts {
        let (towards, irradiance) = arriving(light, view, self.place);
        let half = (towards + self.to_eye()).normalize();
        let (nl, nh, nv) = (self.normal.dot(towards), self.normal.dot(half), self.nv());
        if nl <= 0.0 {
            return Parts::default();
        }
        let a2 = self.roughness().powi(4);
        let distribution = a2 / (PI * (nh * nh * (a2 - 1.0) + 1.0).powi(2));
        let masking = 1.0 / (1.0 + lambda(nl, a2) + lambda(nv, a2));
        let f0 = self.mirrored;
        let fresnel = f0 + (DVec3::ONE - f0) * (1.0 - towards.dot(half)).powi(5);
        let scattered = self.colour / PI * (DVec3::ONE - fresnel);
        let mirrored = fresnel * (distribution * masking / (4.0 * nl * nv));
        Parts {
            scattered: scattered * nl * irradiance,
            mirrored: mirrored * nl * irradiance,
        }
    }

    /// What it sends to the eye of light from everywhere, by the split sum.
    pub(crate) fn surrounded(&self, around: &Around) -> Parts {
        let of_base = DVec3::ONE - self.mirrored;
        let scattered = self.colour * of_base * (1.0 - fresnel_mean(self.nv(), 16));
        let normal = around.to_world * self.normal;
        let [all, fifth] = mirrored_parts(self.nv(), self.roughness(), 16);
        let eye = self.to_eye();
        let way = around.to_world * (2.0 * self.normal.dot(eye) * self.normal - eye);
        let turned = way * concentration(self.roughness);
        Parts {
            scattered: scattered * (around.middle + around.slope * normal * (2.0 / 3.0)),
            mirrored: (self.mirrored * (all - fifth) + fifth)
                * (around.middle + around.slope * turned),
        }
    }
}

/// Radiance from everywhere: `middle + slope · direction`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Around {
    pub(crate) to_world: DMat3,
    pub(crate) middle: DVec3,
    pub(crate) slope: DMat3,
}

/// How much a perfect mirror of microfacets mirrors of light from everywhere, and
/// how much of it by the fifth power of Fresnel's term: sums over `8 n × n` half
/// vectors of the GGX distribution.
pub(crate) fn mirrored_parts(nv: f64, roughness: f64, n: u32) -> [f64; 2] {
    let a2 = roughness.powi(4);
    let view = DVec3::new((1.0 - nv * nv).sqrt(), 0.0, nv);
    let rings = 8 * n;
    let mut sums = [0.0; 2];
    for i in 0..rings {
        // Closer together where u comes near 1, at the edge of the distribution.
        let x = (f64::from(i) + 0.5) / f64::from(rings);
        let (u, width) = (1.0 - (1.0 - x) * (1.0 - x), 2.0 * (1.0 - x));
        let c2 = (1.0 - u) / (1.0 + (a2 - 1.0) * u);
        let (c, s) = (c2.sqrt(), (1.0 - c2).sqrt());
        for j in 0..n {
            // Half a turn: the other half is the mirror image.
            let turn = PI * (f64::from(j) + 0.5) / f64::from(n);
            let half = DVec3::new(s * turn.cos(), s * turn.sin(), c);
            let vh = view.dot(half);
            let nl = 2.0 * vh * c - nv;
            if vh <= 0.0 || nl <= 0.0 {
                continue;
            }
            let masking = 1.0 / (1.0 + lambda(nl, a2) + lambda(nv, a2));
            let weight = width * masking * vh / (nv * c);
            sums[0] += weight;
            sums[1] += weight * (1.0 - vh).powi(5);
        }
    }
    sums.map(|sum| sum / f64::from(rings * n))
}

/// The mean over light from everywhere of the fifth power of Fresnel's term.
pub(crate) fn fresnel_mean(nv: f64, n: u32) -> f64 {
    let view = DVec3::new((1.0 - nv * nv).sqrt(), 0.0, nv);
    let mut sum = 0.0;
    for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
        let z2 = (f64::from(i) + 0.5) / f64::from(n);
        let turn = PI * (f64::from(j) + 0.5) / f64::from(n);
        let across = (1.0 - z2).sqrt();
        let light = DVec3::new(across * turn.cos(), across * turn.sin(), z2.sqrt());
        let vh = (0.5 * (1.0 + view.dot(light))).max(0.0).sqrt();
        sum += (1.0 - vh).powi(5);
    }
    sum / f64::from(n * n)
}

/// The mean cosine of directions with the one mirrored when seen from straight
/// above, each weighted by its own.
pub(crate) fn concentration(roughness: f64) -> f64 {
    let a2 = roughness.powi(4);
    let n = 256;
    let (mut sum, mut weights) = (0.0, 0.0);
    for i in 0..n {
        let u = (f64::from(i) + 0.5) / f64::from(n);
        let nl = 2.0 * (1.0 - u) / (1.0 + (a2 - 1.0) * u) - 1.0;
        if nl > 0.0 {
            sum += nl * nl;
            weights += nl;
        }
    }
    sum / weights
}

/// Irradiance on a plane that faces `normal`: a sum over `n × n` directions.
pub(crate) fn irradiance(normal: DVec3, n: u32, radiance: &dyn Fn(DVec3) -> DVec3) -> DVec3 {
    let (u, v) = normal.any_orthonormal_pair();
    let mut sum = DVec3::ZERO;
    for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
        let z2 = (f64::from(i) + 0.5) / f64::from(n);
        let turn = TAU * (f64::from(j) + 0.5) / f64::from(n);
        let across = (1.0 - z2).sqrt();
        sum += radiance(u * (across * turn.cos()) + v * (across * turn.sin()) + normal * z2.sqrt());
    }
    sum * (PI / f64::from(n * n))
}

/// Light around `way` as a surface of a roughness blurs it that is seen from
/// straight above: a sum over `n × n` half vectors.
pub(crate) fn blurred(
    way: DVec3,
    roughness: f64,
    n: u32,
    radiance: &dyn Fn(DVec3) -> DVec3,
) -> DVec3 {
    let a2 = roughness.powi(4);
    let (u, v) = way.any_orthonormal_pair();
    let (mut sum, mut weights) = (DVec3::ZERO, 0.0);
    for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
        let part = (f64::from(i) + 0.5) / f64::from(n);
        let turn = TAU * (f64::from(j) + 0.5) / f64::from(n);
        let c2 = (1.0 - part) / (1.0 + (a2 - 1.0) * part);
        let nl = 2.0 * c2 - 1.0;
        if nl > 0.0 {
            let across = 2.0 * (c2 * (1.0 - c2)).sqrt();
            let light = u * (across * turn.cos()) + v * (across * turn.sin()) + way * nl;
            sum += radiance(light) * nl;
            weights += nl;
        }
    }
    sum / weights
}

/// An equirectangular picture of what comes from each direction.
pub(crate) fn picture(width: u32, radiance: &dyn Fn(DVec3) -> DVec3) -> ImageData {
    let height = width / 2;
    let texel = |k: u32| {
        let turn = TAU * ((f64::from(k % width) + 0.5) / f64::from(width) - 0.5);
        let tilt = PI * (f64::from(k / width) + 0.5) / f64::from(height);
        let across = tilt.sin();
        let at = DVec3::new(across * turn.sin(), tilt.cos(), -across * turn.cos());
        radiance(at).as_vec3().extend(1.0).to_array()
    };
    let texels: Vec<_> = (0..width * height).map(texel).collect();
    let desc = TextureDesc::d2(width, height, Format::Rgba32Float);
    ImageData::from_rgba_f32(desc, &texels).unwrap()
}
