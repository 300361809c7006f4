//! Recipes of pipelines: all that a driver needs to compile one, so that other drivers can compile it, too.

use serde::{Deserialize, Serialize};
use shaders_glsl::{Shader, Stage};

use super::Format;
use base::error::{Error, Kind, Result};

/// All that a driver needs to compile a pipeline.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recipe {
    /// Names of its shaders: a kernel, or a vertex and a fragment shader.
    pub shaders: Vec<String>,
    /// Values of the first specialisation constants; the others keep their defaults.
    pub constants: Vec<u32>,
    /// Targets of a drawing; `None` for a kernel.
    pub targets: Option<Targets>,
}

/// What a drawing draws into, and how.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Targets {
    /// Formats of the pictures, of which the last may be depth.
    pub formats: Vec<Format>,
    /// Number of layers that are drawn at once.
    pub views: u32,
    /// What becomes of a pixel that several triangles cover.
    pub overlap: Overlap,
}

/// What becomes of a pixel that several triangles cover, or that was drawn before.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Overlap {
    /// All are blended.
    Blended,
    /// The nearest of the target and of all triangles is kept, by the picture of depth, which must be there;
    /// the first one of several at the same depth.
    Nearest,
}

impl Recipe {
    /// Returns the recipe of a kernel.
    pub(super) fn kernel(shader: &Shader, constants: &[u32]) -> Self {
        Recipe { shaders: vec![shader.name.to_owned()], constants: constants.to_vec(), targets: None }
    }

    /// Returns the recipe of a drawing.
    pub(super) fn drawing(shaders: [&Shader; 2], constants: &[u32], targets: Targets) -> Self {
        let shaders = shaders.map(|shader| shader.name.to_owned()).to_vec();
        Recipe { shaders, constants: constants.to_vec(), targets: Some(targets) }
    }

    /// Returns the name of the pipeline, with its constants that are not 0: `slab (GROUP = 64, SHADED)`.
    pub fn name(&self) -> String {
        let stage = if self.targets.is_some() { Stage::Fragment } else { Stage::Compute };
        let main = self.shaders.last().map_or("", String::as_str);
        let names = shader(main, stage).map_or(&[][..], |shader| shader.constants);
        let mut told: Vec<String> = names
            .iter()
            .zip(&self.constants)
            .filter(|&(_, &value)| value != 0)
            .map(|(name, &value)| if value == 1 { (*name).to_owned() } else { format!("{name} = {value}") })
            .collect();
        if let Some(targets) = self.targets.as_ref().filter(|targets| targets.views > 1) {
            told.push(format!("{} views", targets.views));
        }
        if told.is_empty() { main.to_owned() } else { format!("{main} ({})", told.join(", ")) }
    }

    /// Finds the kernel of the recipe, or its vertex and its fragment shader.
    ///
    /// # Errors
    /// If there are no such shaders.
    pub(super) fn found(&self) -> Result<Vec<&'static Shader>> {
        let stages: &[Stage] =
            if self.targets.is_some() { &[Stage::Vertex, Stage::Fragment] } else { &[Stage::Compute] };
        let pairs = self.shaders.iter().zip(stages);
        let found: Option<Vec<_>> = pairs.map(|(name, &stage)| shader(name, stage)).collect();
        found.filter(|found| found.len() == stages.len()).ok_or_else(|| {
            let message = format!("there is no pipeline of the shaders {}", self.shaders.join(" and "));
            Error::new(Kind::Usage, "VGS-GPU-031", message)
        })
    }
}

/// Finds the shader with this name and stage.
fn shader(name: &str, stage: Stage) -> Option<&'static Shader> {
    shaders_glsl::ALL.iter().copied().find(|shader| shader.name == name && shader.stage == stage)
}
