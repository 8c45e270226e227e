use super::SynthConfig;
use crate::Result;
use softtissue_body::BodyModel;
use softtissue_body::procedural::{Anatomy, Levels, ProceduralBody, SubdivisionMap, generate, generate_levels};
use softtissue_geometry::Frames;

/// The body on which the flesh is simulated and the one that is scanned.
#[derive(Clone, Debug)]
pub struct Bodies {
    /// Level 0: carries the flesh.
    pub coarse: ProceduralBody,
    /// Level 1 and the map that lifts fields to it, where the set is of that level.
    pub fine: Option<(ProceduralBody, SubdivisionMap)>,
}

impl Bodies {
    /// Makes the body that a configuration asks for, or reads its file: flesh moves on its own mesh then.
    pub fn generate(config: &SynthConfig) -> Result<Self> {
        Ok(if config.has_body_file() {
            let model = BodyModel::read(&config.body)?;
            Self { coarse: ProceduralBody { anatomy: Anatomy::of(&model)?, model }, fine: None }
        } else if config.level == 0 {
            Self { coarse: generate(&config.procedural())?, fine: None }
        } else {
            let Levels { coarse, fine, subdivision } = generate_levels(&config.procedural())?;
            Self { coarse, fine: Some((fine, subdivision)) }
        })
    }

    /// Deltas of the simulated level on the mesh that is scanned.
    pub(super) fn lifted(&self, flesh: Frames) -> Frames {
        let Some((fine, map)) = &self.fine else { return flesh };
        let mut lifted = Frames::new(fine.model.vertex_count());
        flesh.iter().for_each(|frame| lifted.push(&map.lift(frame)));
        lifted
    }

    /// The body that is scanned.
    pub fn scanned(&self) -> &ProceduralBody {
        self.fine.as_ref().map_or(&self.coarse, |(fine, _)| fine)
    }
}
