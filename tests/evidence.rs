//! The script that makes the evidence tables, on the smallest job: every table is there and has every method in it, and a
//! missing one fails.

use crate::support::{Said, data_dir, folder, tiny_run};
use softtissue_eval::Metrics;
use std::path::Path;
use std::process::Command;

/// The parts that are run here; `.ci/run` runs the others.
const PARTS: [&str; 3] = ["methods", "weights", "casas"];

fn evidence(home: &Path, arguments: &[&str]) -> Said {
    let mut command = Command::new("scripts/evidence.sh");
    command.current_dir(env!("CARGO_MANIFEST_DIR")).args(arguments);
    command.env("SIZE", "tiny").env("CONFIG", "tests/evidence.toml").env("SEEDS", "1 2");
    command.env("OUT", home.join("out")).env("RUNS", home.join("runs")).env("DATA", data_dir());
    command.env("SOFTTISSUE", env!("CARGO_BIN_EXE_softtissue"));
    Said::of(&command.output().expect("a shell"))
}

#[test]
fn the_evidence_script_writes_every_table_and_says_what_is_missing() {
    let home = folder("evidence");
    // Its scans are the same, and there is one that makes them.
    tiny_run();
    evidence(&home, &PARTS).fine();
    let out = home.join("out");
    let read = |name: &str| std::fs::read_to_string(out.join(name)).expect(name);
    let measures = |name: &str| Metrics::read(&out.join(format!("{name}.json"))).expect(name);

    let compared = measures("methods");
    for method in ["softtissue", "softsmpl", "casas-otaduy", "dyna"] {
        assert!(compared.methods[method].soft_ratio.is_some(), "{method}");
        assert!(compared.timing[method].whole_ms > 0.0 && !compared.bmi_response[method].is_empty(), "{method}");
        assert!(compared.people["s01"].methods[method].soft_ratio.is_some(), "{method}");
        assert_eq!(measures(&format!("held-out-{method}")).method.as_deref(), Some(method));
    }
    assert!(compared.timing["softsmpl"].part("encoder").is_some_and(|ms| ms > 0.0), "SoftSMPL encodes the pose");
    assert!(measures("weights").methods.contains_key("casas-otaduy/unweighted"));
    // What concerns one clip alone stays with the run.
    assert!(measures("casas").clips.is_empty() && measures("methods").clips.is_empty());
    let folds = home.join("runs/casas-otaduy/metrics-leave-one-sequence-out.json");
    let folds = Metrics::read(&folds).expect("the run's own measures");
    assert_eq!(folds.clips.iter().filter_map(|c| c.fold.as_deref()).collect::<Vec<_>>(), FOLDS);
    assert!(folds.clips.iter().all(|c| c.methods["casas-otaduy"].regions["belly-chest"].frame_std_mm.is_some()));
    let (seeds, index) = (read("seeds.txt"), read("README.md"));
    let row = seeds.lines().find(|l| l.starts_with("16 numbers")).expect("a row of table 1");
    assert_eq!(row.matches('±').count(), 3, "{seeds}");
    for name in ["methods", "held-out-dyna", "seeds", "weights", "casas", "report/casas.html", "| weights |"] {
        assert!(index.contains(name), "{name} is missing in: {index}");
    }

    // Finished parts are kept, and checking them says what is not whole.
    let before = read("methods.txt");
    evidence(&home, &[&["--check"], &PARTS[..]].concat()).fine();
    assert_eq!(read("methods.txt"), before);
    let missing = |file: &str, from: &str, to: &str, part: &str, words: [&str; 2]| {
        let whole = read(file);
        std::fs::write(out.join(file), whole.replace(from, to)).expect("a file");
        let said = evidence(&home, &["--check", part]);
        assert_eq!(said.code, 1, "{}{}", said.out, said.err);
        assert!(words.iter().all(|w| said.err.contains(w)), "{}", said.err);
        std::fs::write(out.join(file), whole).expect("a file");
    };
    missing("methods.txt", "\ndyna  ", "\nnobody  ", "methods", ["methods.txt", "dyna"]);
    missing("methods.json", "\"softsmpl\": {", "\"nobody\": {", "methods", ["methods.json", "softsmpl"]);
    missing("methods.json", "\n  \"timing\"", "\n  \"tempo\"", "methods", ["methods.json", "timing"]);
    missing("casas.txt", FOLDS[1], "s01/nothing", "casas", ["casas.txt", FOLDS[1]]);
    std::fs::remove_file(out.join("weights.json")).expect("a file");
    assert_eq!(evidence(&home, &["--check", "weights"]).code, 1);
    assert_eq!(evidence(&home, &["everything"]).code, 2);
}

/// The heaviest person's sequences that the smallest job has of the paper's five.
const FOLDS: [&str; 2] = ["s01/jumping_jacks", "s01/one_leg_jump"];
