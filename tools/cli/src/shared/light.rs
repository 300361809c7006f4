//! Flags of the light.

use std::str::FromStr;

use clap::Args;
use engine::render::Camera;
use engine::transfer::{FixedTo, Light, MOST_FILL, Material};
use glam::DVec3;

use super::viewing::number;

/// Flags of the light, and of how surfaces respond to it.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Light")]
pub struct LightArguments {
    /// Where the light comes from: degrees to the right and up from the viewer, and it goes along with a turntable; or a
    /// side of the patient (left, anterior-superior ...), and it stays there [default: above the viewer's left shoulder,
    /// -22,25]
    #[arg(long, value_name = "RIGHT,UP|SIDE", allow_hyphen_values = true)]
    light_direction: Option<LightDirection>,
    /// Light from where the viewer is, so that both sides are alike
    #[arg(long, conflicts_with = "light_direction")]
    headlight: bool,
    /// A fill light from the other side, mirrored from left to right: its share of the light, 0 to 0.5
    #[arg(long, value_name = "SHARE", default_value_t = 0.0, value_parser = fill)]
    fill_light: f64,
    /// Share of the colour that needs no light; these four are as the transfer function says by default
    #[arg(long, value_name = "SHARE", value_parser = share)]
    ambient: Option<f64>,
    /// Share of the colour that follows the angle to the light
    #[arg(long, value_name = "SHARE", value_parser = share)]
    diffuse: Option<f64>,
    /// Strength of the highlight
    #[arg(long, value_name = "SHARE", value_parser = share)]
    specular: Option<f64>,
    /// Exponent of the highlight: greater is smaller and sharper, as of wet bone
    #[arg(long, value_name = "POWER", value_parser = shininess)]
    shininess: Option<f64>,
}

impl LightArguments {
    /// Returns the light that the flags ask for.
    pub fn light(&self) -> Light {
        let light = match &self.light_direction {
            Some(LightDirection(light)) => *light,
            None if self.headlight => Light::HEAD,
            None => Light::default(),
        };
        Light { fill: self.fill_light, ..light }
    }

    /// Warns if a flag asks for a light that a material does not show.
    pub fn warn_if_unlit(&self, material: &Material) {
        if self.change(&mut material.clone()) && !material.shade {
            tracing::warn!(
                "flags of the light have no effect: this transfer function is unlit; add --shade on"
            );
        }
    }

    /// Changes what the flags name of a material. Returns true if a flag asks for a light at all.
    pub fn change(&self, material: &mut Material) -> bool {
        let mut asked = self.light() != Light::default();
        for (flag, value) in [
            (self.ambient, &mut material.ambient),
            (self.diffuse, &mut material.diffuse),
            (self.specular, &mut material.specular),
            (self.shininess, &mut material.power),
        ] {
            asked |= flag.is_some();
            *value = flag.unwrap_or(*value);
        }
        asked
    }
}

/// Direction of the light.
#[derive(Clone, Copy, Debug)]
struct LightDirection(Light);

impl FromStr for LightDirection {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if let Some(angles) = angles(text) {
            let within = angles.iter().all(|angle| angle.abs() <= 180.0);
            return within
                .then(|| LightDirection(Light::at_angles(angles)))
                .ok_or_else(|| "angles lie between -180 and 180 degrees".to_owned());
        }
        let camera = Camera::from_side(text, DVec3::ZERO, 1.0, 30.0, 1.0)
            .map_err(|e| format!("{e}; or give two angles, as -22,25: {}", e.help))?;
        let towards = camera.eye.to_array();
        Ok(LightDirection(Light { fixed_to: FixedTo::Patient, towards, fill: 0.0 }))
    }
}

fn angles(text: &str) -> Option<[f64; 2]> {
    let (right, up) = text.split_once(',')?;
    let angle = |text: &str| text.trim().parse::<f64>().ok().filter(|v| v.is_finite());
    Some([angle(right)?, angle(up)?])
}

/// Parses a share.
pub fn share(text: &str) -> Result<f64, String> {
    number(text, 0.0..=1.0)
}

fn fill(text: &str) -> Result<f64, String> {
    let found = text.parse().ok().filter(|v| (0.0..=MOST_FILL).contains(v));
    found.ok_or_else(|| {
        format!("a number from 0 to {MOST_FILL} is needed: at {MOST_FILL} both lights are equally strong")
    })
}

fn shininess(text: &str) -> Result<f64, String> {
    number(text, 0.0..=1000.0)
}
