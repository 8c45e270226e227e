//! Sections of a configuration file, those that crates without burn have.

#![no_main]

use libfuzzer_sys::fuzz_target;
use softtissue_bundle::descriptor::DescriptorConfig;
use softtissue_clips::SplitConfig;
use softtissue_import::AnnyConfig;
use softtissue_synth::dataset::SynthConfig;

fuzz_target!(|data: &[u8]| {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let Ok(table) = text.parse::<toml::Table>() else { return };
    if let Ok(synth) = toml::from_str::<SynthConfig>(text) {
        let _ = synth.check();
    }
    let _ = toml::from_str::<SplitConfig>(text);
    let _ = toml::from_str::<DescriptorConfig>(text);
    let _ = toml::from_str::<AnnyConfig>(text);
    let _ = table.to_string();
});
