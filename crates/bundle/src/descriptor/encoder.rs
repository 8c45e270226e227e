use crate::Linear;
use glam::Vec3;
use softtissue_geometry::{axis_angle_from_rotation, rotation_from_axis_angle};

/// `Epose` of SoftSMPL eq. 12: the rotations of the joints below the root to the few numbers `p` that the shape of the
/// posed body depends on most, so that what is one person's habit and moves little (wrists, neck) is left out.
///
/// Input: axis angles of joints `1..J` in order, `[3 (J - 1)]`, radians, each taken through its rotation so that equal
/// rotations are equal numbers (angle at most pi). Fully connected layers with `tanh` between them and nothing after the
/// last: `p` is smooth in the pose, and so are its second differences.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PoseEncoder {
    /// In order; the last one's outputs are `p [P]`.
    pub layers: Vec<Linear>,
}

/// Working memory of a [`PoseEncoder`].
#[derive(Clone, Debug)]
pub struct EncoderScratch {
    input: Vec<f32>,
    output: Vec<f32>,
}

impl PoseEncoder {
    /// Numbers `P` of a pose.
    pub fn latent_count(&self) -> usize {
        self.layers.last().map_or(0, Linear::outputs)
    }
    /// Working memory that fits.
    pub fn scratch(&self) -> EncoderScratch {
        let sizes = self.layers.iter().flat_map(|l| [l.inputs(), l.outputs()]);
        let widest = sizes.max().unwrap_or(0);
        EncoderScratch { input: vec![0.0; widest], output: vec![0.0; widest] }
    }
    /// `p [P]` of a pose `rotations [J]`, the root's among them and left out. Allocates nothing. Panics if a length is
    /// wrong.
    pub fn apply(&self, rotations: &[Vec3], scratch: &mut EncoderScratch, out: &mut [f32]) {
        let EncoderScratch { input, output } = scratch;
        pose_numbers_into(rotations, &mut input[..3 * (rotations.len() - 1)]);
        for (i, layer) in self.layers.iter().enumerate() {
            let y = &mut output[..layer.outputs()];
            layer.apply(&input[..layer.inputs()], y);
            if i + 1 < self.layers.len() {
                y.iter_mut().for_each(|y| *y = y.tanh());
            }
            std::mem::swap(input, output);
        }
        out.copy_from_slice(&input[..self.latent_count()]);
    }
    /// Whether it is an encoder of poses of `joints` joints with finite numbers; the sentence says what is not.
    pub fn check(&self, joints: usize) -> Result<(), String> {
        let mut size = 3 * joints.saturating_sub(1);
        if self.layers.is_empty() {
            return Err("the pose encoder has no layer".into());
        }
        for (i, layer) in self.layers.iter().enumerate() {
            if layer.inputs() != size || layer.bias.len() != layer.outputs() || layer.outputs() == 0 {
                return Err(format!(
                    "layer {i} of the pose encoder is {} to {} with {} biases, but {size} numbers come in",
                    layer.inputs(),
                    layer.outputs(),
                    layer.bias.len()
                ));
            }
            if layer.weight.numbers().iter().chain(&layer.bias).any(|x| !x.is_finite()) {
                return Err(format!("layer {i} of the pose encoder holds a number that is not finite"));
            }
            size = layer.outputs();
        }
        Ok(())
    }
}

/// What a [`PoseEncoder`] sees of a pose `rotations [J]`: `[3 (J - 1)]`, radians.
pub fn pose_numbers(rotations: &[Vec3]) -> Vec<f32> {
    let mut numbers = vec![0.0; 3 * (rotations.len() - 1)];
    pose_numbers_into(rotations, &mut numbers);
    numbers
}

fn pose_numbers_into(rotations: &[Vec3], numbers: &mut [f32]) {
    for (w, out) in rotations[1..].iter().zip(numbers.chunks_exact_mut(3)) {
        axis_angle_from_rotation(rotation_from_axis_angle(*w)).write_to_slice(out);
    }
}
