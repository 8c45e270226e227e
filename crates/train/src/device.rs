//! Where tensors live, chosen by name at run time.

use crate::{Result, TrainError};
use burn::tensor::Device;

/// The device of a name: `flex` (this processor, the default), `ndarray` (this processor, another implementation)
/// or `wgpu` (a graphics processor). A name without its feature in this build is an error that says so.
///
/// Everything else in the project names its device; a backend's own default is never used.
pub fn parse(name: &str) -> Result<Device> {
    match name {
        "flex" => Ok(Device::flex()),
        #[cfg(feature = "ndarray")]
        #[expect(deprecated, reason = "a second processor backend to hold flex against, as long as burn has it")]
        "ndarray" => Ok(Device::ndarray()),
        #[cfg(feature = "wgpu")]
        "wgpu" => Ok(Device::wgpu(burn::tensor::DeviceKind::DefaultDevice)),
        missing if ["ndarray", "wgpu"].contains(&missing) => Err(TrainError::Config(format!(
            "this build has no device {name:?}: build with `--features {name}`, or take `--device flex`"
        ))),
        _ => Err(TrainError::Config(format!("there is no device {name:?}: take flex, ndarray or wgpu"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_device_is_known_missing_or_unknown() {
        assert!(!parse("flex").expect("always there").is_autodiff());
        #[cfg(not(feature = "wgpu"))]
        assert!(parse("wgpu").unwrap_err().to_string().contains("--features wgpu"));
        #[cfg(not(feature = "ndarray"))]
        assert!(parse("ndarray").unwrap_err().to_string().contains("--features ndarray"));
        assert!(parse("tpu").unwrap_err().to_string().contains("flex, ndarray or wgpu"));
    }
}
