use crate::{Bundle, BundleError, Player, Result, StepReport};
use glam::Vec3;
use rayon::prelude::*;
use softtissue_body::Pose;
use std::ops::Deref;

/// Blocks of the pose correctives or of the delta modes that all characters of a thread take in turn while they lie in the
/// cache.
const TILE: usize = 4;

/// Many characters that share one bundle: what is read of it for a frame is read once for all of a thread's characters and
/// not once for each. Every character moves as a [`Player`] of its own would, to the bit, whatever the threads.
pub struct Batch<B: Deref<Target = Bundle>> {
    characters: Vec<Character<B>>,
    /// Characters of a thread.
    share: usize,
}

struct Character<B: Deref<Target = Bundle>> {
    player: Player<B>,
    report: StepReport,
    /// Whether this frame has deltas.
    predicts: bool,
}

impl<B: Deref<Target = Bundle> + Clone + Send> Batch<B> {
    /// A character of each shape, at rest, for `threads` threads of rayon's (at least one; more than there are characters is
    /// as good as one each).
    pub fn new(bundle: B, shapes: &[&[f32]], threads: usize) -> Result<Self> {
        let Some((first, others)) = shapes.split_first() else {
            return Err(BundleError::Input("no shape; give one for each character".into()));
        };
        let mut players = vec![Player::new(bundle, first)?];
        for shape in others {
            let player = players[0].another(shape)?;
            players.push(player);
        }
        let character = |player| Character { player, report: StepReport::default(), predicts: false };
        let share = shapes.len().div_ceil(threads.max(1));
        Ok(Self { characters: players.into_iter().map(character).collect(), share })
    }

    /// One frame of the bundle's rate for all: a pose each. With one thread nothing is allocated.
    ///
    /// # Errors
    /// Another number of poses.
    pub fn step(&mut self, poses: &[Pose]) -> Result<()> {
        if poses.len() != self.characters.len() {
            return Err(BundleError::Input(format!(
                "{} poses for {} characters; give one each",
                poses.len(),
                self.characters.len()
            )));
        }
        if self.share == self.characters.len() {
            step(&mut self.characters, poses);
        } else {
            let characters = self.characters.par_chunks_mut(self.share);
            characters.zip(poses.par_chunks(self.share)).for_each(|(characters, poses)| step(characters, poses));
        }
        Ok(())
    }

    /// Characters.
    pub fn len(&self) -> usize {
        self.characters.len()
    }
    /// Whether there is none, which there is not.
    pub fn is_empty(&self) -> bool {
        self.characters.is_empty()
    }
    /// What the last step had to do for a character.
    pub fn report(&self, character: usize) -> StepReport {
        self.characters[character].report
    }
    /// Posed vertices with deltas of the last step, `[V]`, metres.
    pub fn vertices(&self, character: usize) -> &[Vec3] {
        self.characters[character].player.shown_vertices()
    }
    /// A character's player: its deltas, its latent numbers.
    pub fn player(&self, character: usize) -> &Player<B> {
        &self.characters[character].player
    }
    /// The same, to set its controls or its detail, or to reset it.
    pub fn player_mut(&mut self, character: usize) -> &mut Player<B> {
        &mut self.characters[character].player
    }
}

/// A frame of some characters on one thread.
fn step<B: Deref<Target = Bundle>>(characters: &mut [Character<B>], poses: &[Pose]) {
    let blocks = characters.first().map_or(0, |c| c.player.blocks());
    // One alone reads everything once as it is.
    let tile = if characters.len() == 1 { blocks.max(1) } else { TILE };
    let tiles = || (0..blocks).step_by(tile).map(|first| first..(first + tile).min(blocks));
    for (character, pose) in characters.iter_mut().zip(poses) {
        character.report = character.player.begin(*pose);
    }
    for tile in tiles() {
        characters.iter_mut().for_each(|c| c.player.correct(tile.clone()));
    }
    for Character { player, report, predicts } in characters.iter_mut() {
        *predicts = player.feel(report, &mut ());
        if *predicts {
            player.predict(report, &mut ());
        }
    }
    for tile in tiles() {
        characters.iter_mut().filter(|c| c.predicts).for_each(|c| c.player.add_deltas(tile.clone()));
    }
    for Character { player, report, predicts } in characters.iter_mut() {
        if *predicts {
            player.settle(report);
        }
        player.vertices();
    }
}
