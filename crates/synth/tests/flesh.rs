//! The flesh on the procedural body.

use softtissue_body::Region;
use softtissue_body::procedural::{ProceduralBody, ProceduralConfig, generate};
use softtissue_synth::flesh::{FleshConfig, FleshRun, Material, Simulator};
use softtissue_synth::motion::{self, Request, Style};

fn body() -> ProceduralBody {
    generate(&ProceduralConfig { level: 0, ..ProceduralConfig::default() }).expect("the embedded body")
}

/// A person of neutral style with the default flesh.
fn run(body: &ProceduralBody, subject: &str, bmi: f64, motion: &str, frames: usize) -> FleshRun {
    let beta = body.anatomy.beta_for_bmi(bmi, &[]).expect("a BMI in range");
    let request = Request { subject, motion, take: 0, frames, fps: 60.0, seed: 1 };
    let clip = motion::generate(&request, &body.model.shaped(&beta), &Style::default()).expect("a known motion");
    let simulator =
        Simulator::new(&body.model, &body.anatomy, &beta, &Material::default(), &FleshConfig::default()).expect("good");
    simulator.run(&clip).expect("a finite run")
}

/// The prototype lost a node at BMI 34 and turned elements inside out at hip and crotch from BMI 25.
#[test]
fn the_heaviest_person_jumps_without_losing_a_node() {
    let body = body();
    let run = run(&body, "heavy", 33.0, "jumping_jacks", 80);
    let largest = run.deltas.points().iter().fold(0.0f32, |m, d| m.max(d.length()));
    assert!((0.01..0.15).contains(&largest), "{largest}");
    let s = &run.statistics;
    assert_eq!(s.inverted_surface_at_frame_end, 0, "{s:?}");
    assert!((s.inverted_element_steps as f64) < 5e-4 * s.element_steps as f64, "{s:?}");
    assert!(s.volume_ratio[0] > 0.975 && s.volume_ratio[1] < 1.015, "{s:?}");
    for region in [Region::Head, Region::Hands, Region::Feet] {
        for v in body.model.regions.vertices(region) {
            assert!((0..run.deltas.len()).all(|t| run.deltas.frame(t)[v as usize].length() < 1e-3));
        }
    }
}

/// Nodes in the armpit, whose elements are cut, had lost their mass with them, and the skin threw them about.
#[test]
fn running_throws_no_node_about() {
    let statistics = run(&body(), "bmi-28", 28.0, "running_on_spot", 150).statistics;
    assert_eq!(statistics.capped_node_steps, 0, "{statistics:?}");
}
