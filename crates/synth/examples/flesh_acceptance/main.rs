//! Prints the acceptance table of the flesh: neutral people of BMI 19, 23 and 28, scatter off, frames after 0.9 s.
//!
//!     flesh_acceptance [GROUP...] [frames=150] [motions=a,b] [bmi=19,28] [MATERIAL=VALUE...] [picture=FILE.png]
//!
//! Groups: step, motions, superposition, convergence, second, repeat, variance; none means all. Ends with 1 if a
//! figure is missed.

mod measures;
mod people;
mod picture;
mod table;
mod variance;

use measures::{damped_sinusoid, distance_mm, mean_height, mean_mm, quantile_mm, rms_mm};
use people::{FIRST_FRAME, Person};
use softtissue_body::Region;
use softtissue_geometry::Frames;
use softtissue_synth::flesh::{FleshConfig, FleshLaw, FleshRun, Material};
use softtissue_synth::motion::MOTIONS;
use std::f32::consts::{PI, TAU};
use table::Table;

/// What to measure, from the command line.
pub(crate) struct Settings {
    groups: Vec<String>,
    bmis: Vec<f64>,
    motions: Vec<String>,
    pub(crate) frames: usize,
    pub(crate) material: Material,
    pub(crate) config: FleshConfig,
    picture: Option<String>,
}

impl Settings {
    fn parse() -> Self {
        let mut groups = Vec::new();
        let mut bmis = vec![19.0, 23.0, 28.0];
        let mut motions: Vec<String> = MOTIONS.iter().map(|m| (*m).to_owned()).collect();
        let mut frames = 150;
        let mut picture = None;
        let mut material = serde_json::to_value(Material::default()).expect("plain numbers");
        for argument in std::env::args().skip(1) {
            match argument.split_once('=') {
                None => groups.push(argument),
                Some(("frames", x)) => frames = x.parse().expect("frames=NUMBER"),
                Some(("motions", x)) => motions = x.split(',').map(str::to_owned).collect(),
                Some(("bmi", x)) => bmis = x.split(',').map(|b| b.parse().expect("bmi=NUMBER")).collect(),
                Some(("picture", x)) => picture = Some(x.to_owned()),
                Some((field, x)) => material[field] = x.parse::<f64>().expect("MATERIAL=NUMBER").into(),
            }
        }
        let material = serde_json::from_value(material).unwrap_or_else(|e| panic!("{e}"));
        Self { groups, bmis, motions, frames, material, config: FleshConfig::default(), picture }
    }

    fn wants(&self, group: &str) -> bool {
        self.groups.is_empty() || self.groups.iter().any(|g| g == group)
    }
}

fn main() {
    let settings = Settings::parse();
    let body = people::body();
    let people: Vec<Person> = settings.bmis.iter().map(|bmi| Person::new(&body, *bmi)).collect();
    let mut table = Table::default();
    table.head();
    for person in &people {
        if settings.wants("step") {
            step(person, &settings, &mut table);
        }
    }
    if settings.wants("motions") {
        motions(&people, &settings, &mut table);
    }
    let middle = &people[people.len() / 2];
    let heaviest = &people[people.len() - 1];
    if settings.wants("superposition") {
        superposition(middle, &settings, &mut table);
    }
    if settings.wants("convergence") {
        convergence(heaviest, &settings, &mut table);
    }
    if settings.wants("second") {
        second_law(middle, &settings, &mut table);
    }
    if settings.wants("repeat") {
        repeat(middle, &settings, &mut table);
    }
    if settings.wants("variance") {
        let (components, frames) = variance::components(&body, &settings);
        let name = format!("components for 95 % of the variance of {frames} true frames of four people");
        table.at_least(&name, components as f64, 20.0, "");
    }
    if let Some(path) = &settings.picture {
        picture::mid_jump(heaviest, &settings, path);
    }
    if table.finish() > 0 {
        std::process::exit(1);
    }
}

/// Free decay after the root has moved up by 5 cm in 0.1 s (raised cosine).
fn step(person: &Person, settings: &Settings, table: &mut Table) {
    const END: usize = 15;
    let rise = |t: f32| 0.025 * (1.0 - (PI * ((t - 0.15) / 0.1).clamp(0.0, 1.0)).cos());
    let run = person.simulate(&settings.material, &settings.config, &person.moved_root("step", 75, rise));
    for region in [Region::Chest, Region::Belly, Region::Buttocks, Region::Thighs] {
        let part = if region == Region::Chest { "breast" } else { region.name() };
        let name = |what: &str| format!("{part}, {what}, BMI {:.0}", person.bmi);
        let decay = &mean_height(&run.deltas, &person.vertices(region))[END..];
        let (hertz, ratio) = damped_sinusoid(decay, 60.0);
        if !matches!(region, Region::Chest | Region::Belly) {
            table.note(&name("frequency and damping ratio"), &format!("{hertz:.2} Hz, {ratio:.3}"));
            continue;
        }
        match person.bmi.round() as i32 {
            19 => table.within(&name("frequency"), hertz, 5.0, 8.0, "Hz"),
            28 => table.within(&name("frequency"), hertz, 3.0, 5.0, "Hz"),
            _ => table.note(&name("frequency"), &format!("{hertz:.2} Hz")),
        }
        table.within(&name("damping ratio"), ratio, 0.1, 0.25, "");
    }
}

fn motions(people: &[Person], settings: &Settings, table: &mut Table) {
    let (mut inverted, mut steps, mut surface) = (0u64, 0u64, 0u64);
    let (mut worst_clip, mut volume, mut still, mut top) = (0.0f64, 0.0f64, 0.0f64, 0.0f64);
    let (mut arm, mut arm_motion) = (0.0f64, String::new());
    let (mut seconds, mut frames) = (0.0, 0usize);
    for person in people {
        for motion in &settings.motions {
            let clip = person.motion(motion, settings.frames);
            let start = cpu_seconds();
            let run = person.simulate(&settings.material, &settings.config, &clip);
            seconds += cpu_seconds() - start;
            frames += clip.len();
            let s = &run.statistics;
            let share = 100.0 * s.inverted_element_steps as f64 / s.element_steps as f64;
            inverted += s.inverted_element_steps;
            steps += s.element_steps;
            surface += s.inverted_surface_at_frame_end;
            worst_clip = worst_clip.max(share);
            volume = s.volume_ratio.iter().fold(volume, |v, r| v.max(100.0 * (r - 1.0).abs()));
            let rms = |region| rms_mm(&run.deltas, &person.vertices(region), FIRST_FRAME);
            still = [Region::Head, Region::Hands, Region::Feet].into_iter().map(rms).fold(still, f64::max);
            top = top.max(quantile_mm(&run.deltas, &person.soft(), FIRST_FRAME, 0.999));
            if person.bmi.round() as i32 == 28 && rms(Region::UpperArms) > arm {
                (arm, arm_motion) = (rms(Region::UpperArms), motion.clone());
            }
            let parts: Vec<String> = Region::ALL[..6].iter().map(|r| format!("{} {:.1}", r.name(), rms(*r))).collect();
            let line = format!(
                "{} mm; inverted {share:.4} %, at frame ends {}, volume {:.4?}, speed {:.1}, capped {}",
                parts.join(" "),
                s.inverted_surface_at_frame_end,
                s.volume_ratio,
                s.max_speed,
                s.capped_node_steps
            );
            table.note(&format!("{motion}, BMI {:.0}", person.bmi), &line);
            if motion == "jumping_jacks" {
                let name = format!("belly rms in jumping jacks, BMI {:.0}", person.bmi);
                match person.bmi.round() as i32 {
                    19 => table.within(&name, rms(Region::Belly), 3.0, 7.0, "mm"),
                    23 => table.within(&name, rms(Region::Belly), 8.0, 13.0, "mm"),
                    28 => table.within(&name, rms(Region::Belly), 15.0, 22.0, "mm"),
                    _ => table.note(&name, &format!("{:.2} mm", rms(Region::Belly))),
                }
            }
        }
    }
    table.at_most("99.9th percentile of soft displacement, largest clip", top, 90.0, "mm");
    table.at_most("head, hands and feet, largest rms", still, 1.0, "mm");
    if !arm_motion.is_empty() {
        table.at_least(&format!("upper arm at BMI 28 in {arm_motion}"), arm, 3.0, "mm");
    }
    table.at_most("change of volume, largest", volume, 1.5, "%");
    table.at_most("inverted element-steps, pooled", 100.0 * inverted as f64 / steps.max(1) as f64, 0.05, "%");
    table.at_most("inverted element-steps, worst clip", worst_clip, 0.3, "%");
    table.at_most("surface elements inverted at a frame's end", surface as f64, 0.0, "");
    // a run that is not finite is an error, which ends the program
    table.row("values that are not finite", "none", "none", true);
    if seconds > 0.0 {
        table.at_most("time of a frame on one core", 1e3 * seconds / frames as f64, 25.0, "ms");
    }
}

/// `|u30 - 6 u5| / |u30|` over soft vertices, root shaken at 3 Hz by 30 and 5 mm, less the unshaken run.
fn superposition(person: &Person, settings: &Settings, table: &mut Table) {
    let shake = |size: f32| {
        let clip = person.moved_root("shake", 120, |t| size * (TAU * 3.0 * t).sin());
        person.simulate(&settings.material, &settings.config, &clip).deltas
    };
    let [still, small, large] = [0.0, 0.005, 0.030].map(shake);
    let soft = person.soft();
    let (mut difference, mut size) = (0.0f64, 0.0f64);
    for t in FIRST_FRAME..large.len() {
        for &v in &soft {
            let u30 = large.frame(t)[v] - still.frame(t)[v];
            let u5 = small.frame(t)[v] - still.frame(t)[v];
            difference += f64::from((u30 - u5 * 6.0).length_squared());
            size += f64::from(u30.length_squared());
        }
    }
    table.at_least(&format!("superposition index, BMI {:.0}", person.bmi), (difference / size).sqrt(), 0.3, "");
}

/// Jumping jacks with 32 and 64 substeps.
fn convergence(person: &Person, settings: &Settings, table: &mut Table) {
    let clip = person.motion("jumping_jacks", settings.frames);
    let run = |substeps| {
        let config = FleshConfig { substeps, ..settings.config.clone() };
        person.simulate(&settings.material, &config, &clip).deltas
    };
    let (mean, high) = distance_mm(&run(32), &run(64), &person.soft(), FIRST_FRAME);
    table.at_most("32 against 64 substeps, mean over soft vertices", mean, 0.3, "mm");
    table.at_most("32 against 64 substeps, 99th percentile", high, 2.0, "mm");
}

/// Jumping jacks under both laws.
fn second_law(person: &Person, settings: &Settings, table: &mut Table) {
    let clip = person.motion("jumping_jacks", settings.frames);
    let run = |law| {
        let config = FleshConfig { law, ..settings.config.clone() };
        person.simulate(&settings.material, &config, &clip)
    };
    let [first, second]: [FleshRun; 2] = [run(FleshLaw::Stiffening), run(FleshLaw::Second)];
    let soft = person.soft();
    let (distance, _) = distance_mm(&first.deltas, &second.deltas, &soft, FIRST_FRAME);
    let mean = |d: &Frames| mean_mm(d, &soft, FIRST_FRAME);
    table.at_least("second law against the first, part of mean |D|", distance / mean(&first.deltas), 0.15, "");
    let sizes = format!("{:.2} and {:.2} mm", mean(&first.deltas), mean(&second.deltas));
    table.note("mean |D| under the first and the second law", &sizes);
    let s = &second.statistics;
    let share = 100.0 * s.inverted_element_steps as f64 / s.element_steps as f64;
    table.note("inverted element-steps under the second law", &format!("{share:.4} %"));
}

fn repeat(person: &Person, settings: &Settings, table: &mut Table) {
    let clip = person.motion("jumping_jacks", 70);
    let run = || person.simulate(&settings.material, &settings.config, &clip).deltas.to_numbers();
    let bits = |x: Vec<f32>| x.into_iter().map(f32::to_bits).collect::<Vec<_>>();
    let same = bits(run()) == bits(run());
    table.row("same seed, same bytes", "equal", if same { "equal" } else { "different" }, same);
}

/// CPU seconds of this thread, which other programs on the machine do not lengthen; 0 where the system does not say.
fn cpu_seconds() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    text.split(' ').next().and_then(|x| x.parse::<f64>().ok()).unwrap_or(0.0) * 1e-9
}
