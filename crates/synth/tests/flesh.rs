//! The flesh on the procedural body.

use softtissue_body::Region;
use softtissue_body::procedural::{ProceduralBody, ProceduralConfig, generate};
use softtissue_synth::flesh::{FleshConfig, Material, Simulator};
use softtissue_synth::motion::{self, Request, Style};

fn body() -> ProceduralBody {
    generate(&ProceduralConfig { level: 0, ..ProceduralConfig::default() }).expect("the embedded body")
}

/// The prototype lost a node at BMI 34 and turned elements inside out at hip and crotch from BMI 25.
#[test]
fn the_heaviest_person_jumps_without_losing_a_node() {
    let body = body();
    let beta = body.anatomy.beta_for_bmi(33.0, &[]).expect("a BMI in range");
    let request = Request { subject: "heavy", motion: "jumping_jacks", take: 0, frames: 80, fps: 60.0, seed: 1 };
    let clip = motion::generate(&request, &body.model.shaped(&beta), &Style::default()).expect("a known motion");
    let simulator =
        Simulator::new(&body.model, &body.anatomy, &beta, &Material::default(), &FleshConfig::default()).expect("good");
    let run = simulator.run(&clip).expect("a finite run");
    let largest = run.deltas.points().iter().fold(0.0f32, |m, d| m.max(d.length()));
    assert!((0.01..0.15).contains(&largest), "{largest}");
    let s = &run.statistics;
    assert_eq!(s.inverted_surface_at_frame_end, 0, "{s:?}");
    assert!((s.inverted_element_steps as f64) < 5e-4 * s.element_steps as f64, "{s:?}");
    assert!(s.volume_ratio[0] > 0.975 && s.volume_ratio[1] < 1.015, "{s:?}");
    for region in [Region::Head, Region::Hands, Region::Feet] {
        for v in body.model.regions.vertices(region) {
            assert!((0..clip.len()).all(|t| run.deltas.frame(t)[v as usize].length() < 1e-3));
        }
    }
}

/// Nodes in the armpit, whose elements are cut, had lost their mass with them, and the skin threw them about.
#[test]
fn running_throws_no_node_about() {
    let body = body();
    let beta = body.anatomy.beta_for_bmi(28.0, &[]).expect("a BMI in range");
    let request = Request { subject: "bmi-28", motion: "running_on_spot", take: 0, frames: 150, fps: 60.0, seed: 1 };
    let clip = motion::generate(&request, &body.model.shaped(&beta), &Style::default()).expect("a known motion");
    let simulator =
        Simulator::new(&body.model, &body.anatomy, &beta, &Material::default(), &FleshConfig::default()).expect("good");
    let statistics = simulator.run(&clip).expect("a finite run").statistics;
    assert_eq!(statistics.capped_node_steps, 0, "{statistics:?}");
}
