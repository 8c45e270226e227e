//! Bad settings, folders and bundles, through the real command (files at the doors stand in `doors`): one sentence, the right exit code, nothing half-written.

use crate::support::{
    Said, bytes_below, command, copy_of_the_run, data_dir, folder, softtissue, tiny_config, tiny_run, tiny_scans,
    tiny_train,
};
use std::path::Path;
use std::process::Command;

fn text(path: &Path) -> String {
    path.display().to_string()
}

#[test]
fn settings_that_make_no_sense() {
    let check = |set: &str| softtissue(&["config", "check", "--set", set]);
    check("regresor.latents=50").refused(2, &["regresor"]);
    check("subspace.training.learning_rat=1").refused(2, &["learning_rat"]);
    for rate in ["-1.0", "nan", "inf", "0.0"] {
        check(&format!("regressor.training.learning_rate={rate}")).refused(2, &["learning_rate"]);
    }
    check("regressor.training.learning_rate=fast").refused(2, &["fast"]);
    check("split.validation_motions=[\"one_leg_jump\"]").refused(2, &["one_leg_jump"]);
    let twice = ["split.validation_subjects=[\"s01\"]", "split.test_subjects=[\"s01\"]"];
    softtissue(&["config", "check", "--set", twice[0], "--set", twice[1]]).refused(2, &["s01", "name it once"]);
    check("method=smpl").refused(2, &["smpl", "softsmpl"]);
    check("regressor.latents=33").refused(2, &["33", "subspace.sizes"]);
    check("synth.motions=[\"dancing\"]").refused(2, &["dancing"]);
    check("synth.fps=0.0").refused(2, &["fps"]);
    check("subspace.training.batch=0").refused(2, &["subspace.training.batch"]);
    check("subspace.training.dropout=1.0").refused(2, &["dropout"]);
    check("regressor.training.adam.beta_2=1.5").refused(2, &["beta_2"]);
    check("fit.solver=newton").refused(2, &["newton"]);
    check("fit.adam.batch=0").refused(2, &["fit.adam.batch"]);
    check("ladder.ar2.strengths=[]").refused(2, &["ladder.ar2.strengths"]);
    check("train.keep_last=0").refused(2, &["train.keep_last"]);
    check("device=tpu").refused(2, &["tpu", "flex"]);
    softtissue(&["config", "check", "--config", "no-such-size"]).refused(3, &["no-such-size", "quick"]);
}

#[test]
fn configuration_files_that_are_none() {
    let dir = folder("bad-config");
    let refuse = |name: &str, bytes: &[u8]| {
        let path = dir.join(name);
        std::fs::write(&path, bytes).expect("a file");
        softtissue(&["config", "check", "--config", &text(&path)]).refused(2, &[name]);
    };
    refuse("deep.toml", format!("a = {}{}", "[".repeat(100_000), "]".repeat(100_000)).as_bytes());
    refuse("binary.toml", &[0xff, 0xfe, 0, 1, 2]);
    refuse("half.toml", b"[regressor\nlatents = 3");
    refuse("typed.toml", b"seed = \"one\"");
    std::fs::write(dir.join("line.toml"), "seed = 1\n\n[fit]\nsolvers = 3\n").expect("a file");
    let line = text(&dir.join("line.toml"));
    softtissue(&["config", "check", "--config", &line]).refused(2, &["line 4", "solvers"]);
    softtissue(&["config", "check", "--config", &text(&dir)]).refused(3, &["bad-config"]);
    // A file states what differs: an empty one is the default.
    let empty = dir.join("empty.toml");
    std::fs::write(&empty, "").expect("a file");
    softtissue(&["config", "check", "--config", &text(&empty)]).fine();
}

#[test]
fn nothing_is_left_to_train_on() {
    let dir = folder("nothing-left");
    let mut run = tiny_train(&tiny_config(&dir), &dir.join("run"));
    run.args(["--set", "split.test_motions=[\"one_leg_jump\", \"punching\", \"shake_hips\"]"]);
    Said::of(&run.output().expect("the command starts")).refused(2, &["train on"]);
    let mut run = tiny_train(&tiny_config(&dir), &dir.join("run"));
    run.args(["--set", "split.test_motions=[]"]);
    Said::of(&run.output().expect("the command starts")).refused(2, &["punching", "--no-eval"]);
    assert!(!dir.join("run").exists(), "bad settings leave nothing behind");
}

#[test]
fn own_scans_without_test_clips_are_not_judged_by_training_clips() {
    let dir = folder("no-test-clips");
    let train = |out: &str, more: &[&str]| {
        let mut run = tiny_train(&tiny_config(&dir), &dir.join(out));
        run.arg("--data").arg(tiny_scans()).args(["--set", "split.test_motions=[]"]).args(more);
        Said::of(&run.output().expect("the command starts"))
    };
    train("judged", &[]).refused(2, &["one_leg_jump", "shake_hips", "split.test_motions", "--no-eval"]);
    assert!(!dir.join("judged/config.toml").exists(), "there is no run to resume");
    train("unjudged", &["--no-eval", "--set", "split.validation_motions=[]", "--set", "regressor.training.steps=2"])
        .fine();
    let manifest = std::fs::read_to_string(dir.join("unjudged/bundle/manifest.json")).expect("a manifest");
    let manifest: serde_json::Value = serde_json::from_str(&manifest).expect("JSON");
    assert_eq!(manifest["info"]["measured"], serde_json::json!({}), "nothing was measured on unseen clips");
    softtissue(&["eval", &text(&dir.join("unjudged"))]).refused(3, &["split.test_motions"]);
}

#[test]
fn there_is_flesh_to_learn() {
    let out = folder("no-flesh").join("run");
    let mut command = tiny_train(&tiny_run().config, &out);
    let all = "subspace.still=[\"belly\", \"chest\", \"buttocks\", \"thighs\", \"upper-arms\", \"calves\", \"head\", \
               \"hands\", \"feet\", \"rest\"]";
    command.args(["--no-eval", "--set", all]);
    Said::of(&command.output().expect("the command starts")).refused(3, &["soft tissue", "subspace.still"]);
    assert!(!out.join("bundle").exists());
    softtissue(&["config", "check", "--set", "subspace.still=[\"nose\"]"]).refused(2, &["nose", "hands"]);
}

#[test]
fn a_training_that_diverges_has_a_code_of_its_own() {
    let out = folder("diverged").join("run");
    let mut command = tiny_train(&tiny_run().config, &out);
    // Smaller than any f32: where the gradient is zero, Adam divides zero by zero.
    command.args(["--no-eval", "--set", "subspace.training.adam.epsilon=1e-300"]);
    let said = Said::of(&command.output().expect("the command starts"));
    said.refused(4, &["subspace-8", "learning_rate"]);
    assert!(!out.join("bundle").exists() && !out.join("stages/subspace-8.safetensors").exists());
}

#[test]
fn output_folders_that_cannot_be() {
    let dir = folder("bad-out");
    let config = tiny_config(&dir);
    let file = dir.join("a-file");
    std::fs::write(&file, "kept").expect("a file");
    let run = |out: &Path| Said::of(&tiny_train(&config, out).output().expect("the command starts"));
    run(&file).refused(2, &["a-file", "folder"]);
    assert_eq!(std::fs::read(&file).expect("the file"), b"kept");
    // The kernel's own file system refuses new folders even to the administrator.
    run(Path::new("/proc/softtissue-run")).refused(5, &["/proc/softtissue-run"]);
    let taken = tiny_run();
    let kept = bytes_below(&taken.path.join("bundle"));
    run(&taken.path).refused(2, &["--resume"]);
    assert_eq!(bytes_below(&taken.path.join("bundle")), kept);
}

#[test]
fn one_run_folder_is_for_one_process() {
    let copy = copy_of_the_run("locked");
    let held = std::fs::OpenOptions::new().write(true).open(copy.join("run.lock")).expect("a lock");
    held.lock().expect("locked");
    softtissue(&["eval", &text(&copy)]).refused(2, &["in use"]);
}

#[cfg(unix)]
#[test]
fn a_symbolic_link_is_followed_and_kept() {
    let dir = folder("linked");
    let real = dir.join("real");
    std::fs::create_dir_all(&real).expect("a folder");
    let link = dir.join("link");
    std::os::unix::fs::symlink(&real, &link).expect("a link");
    let mut run = tiny_train(&tiny_config(&dir), &link);
    run.arg("--no-eval");
    Said::of(&run.output().expect("the command starts")).fine();
    assert!(link.is_symlink() && real.join("bundle/manifest.json").exists());
}

#[cfg(unix)]
#[test]
fn a_full_disk_is_named_and_leaves_no_half_file() {
    let dir = folder("full");
    let config = tiny_config(&dir);
    let out = dir.join("run");
    // A limit on file size stands in for a full disk: writes fail in the middle of a file.
    let script = format!(
        "trap '' XFSZ; ulimit -f 64; exec '{}' train --config '{}' --out '{}' --data-dir '{}'",
        env!("CARGO_BIN_EXE_softtissue"),
        config.display(),
        out.display(),
        data_dir().display()
    );
    tiny_run();
    let said = Said::of(&Command::new("sh").args(["-c", &script]).output().expect("a shell"));
    said.refused(5, &["write"]);
    let half: Vec<_> = bytes_below(&out).into_iter().filter(|(p, _)| p.to_string_lossy().ends_with(".tmp")).collect();
    assert!(half.is_empty(), "{half:?}");
    let mut resumed = tiny_train(&config, &out);
    resumed.args(["--resume", "--no-eval"]);
    Said::of(&resumed.output().expect("the command starts")).fine();
}

#[test]
fn folders_without_scans() {
    let dir = folder("bad-scans");
    let config = tiny_config(&dir);
    for name in ["missing", "empty"] {
        let mut run = tiny_train(&config, &dir.join("run"));
        run.arg("--data").arg(dir.join(name));
        Said::of(&run.output().expect("the command starts")).refused(3, &[name]);
        assert!(!dir.join("run/config.toml").exists(), "there is no run to resume");
        std::fs::create_dir_all(dir.join("empty")).expect("a folder");
    }
    let (scans, out) = (text(&dir.join("empty")), text(&dir.join("empty/inside")));
    let import = ["import", "scans", &scans, "--out", &out, "--data-dir", &text(&data_dir())];
    softtissue(&import).refused(2, &["inside", "choose another"]);
}

/// Exports a motion of the tiny bundle as OBJ frames `SUBJECT/MOTION/*.obj`.
fn obj_sequence(home: &Path, subject: &str, motion: &str) {
    let bundle = text(&tiny_run().path.join("bundle"));
    let out = text(&home.join(subject).join(motion));
    softtissue(&[
        "animate",
        "--bundle",
        &bundle,
        "--motion",
        &format!("synth:{motion}"),
        "--frames",
        "40",
        "--out",
        &out,
    ])
    .fine();
}

#[test]
fn own_obj_sequences_train() {
    let dir = folder("own-scans");
    let home = dir.join("scans");
    for motion in ["jumping_jacks", "punching", "shake_hips", "one_leg_jump"] {
        obj_sequence(&home, "anna", motion);
    }
    let mut run = tiny_train(&tiny_config(&dir), &dir.join("run"));
    run.arg("--data").arg(&home);
    Said::of(&run.output().expect("the command starts")).fine();
    let metrics: serde_json::Value =
        serde_json::from_slice(&std::fs::read(dir.join("run/metrics.json")).expect("measures")).expect("JSON");
    assert_eq!(metrics["truth"], false, "nobody knows the truth of one's own scans");

    // The same frames at another rate.
    let fast = dir.join("fast");
    softtissue(&[
        "import",
        "scans",
        &text(&home),
        "--out",
        &text(&fast),
        "--fps",
        "120",
        "--data-dir",
        &text(&data_dir()),
    ])
    .fine();
    let mut run = tiny_train(&tiny_config(&dir), &dir.join("run-fast"));
    run.arg("--data").arg(&fast);
    Said::of(&run.output().expect("the command starts")).refused(3, &["120", "resample"]);
}

#[test]
fn bundles_and_motions_that_do_not_fit() {
    let run = tiny_run();
    let dir = folder("bad-bundle");
    let bundle = dir.join("bundle");
    std::fs::create_dir_all(&bundle).expect("a folder");
    for (path, bytes) in bytes_below(&run.path.join("bundle")) {
        std::fs::write(bundle.join(path), bytes).expect("a file");
    }
    let animate = |bundle: &Path, motion: &str| {
        softtissue(&["animate", "--bundle", &text(bundle), "--motion", motion, "--out", &text(&dir.join("a.glb"))])
    };
    animate(&bundle, "synth:dancing").refused(2, &["dancing"]);
    animate(&bundle, "no-such-file").refused(3, &["no-such-file"]);
    animate(&dir.join("nowhere"), "synth:hips").refused(3, &["nowhere"]);
    let model = bundle.join("model.safetensors");
    let mut bytes = std::fs::read(&model).expect("a model");
    *bytes.last_mut().expect("bytes") ^= 1;
    std::fs::write(&model, &bytes).expect("a model");
    animate(&bundle, "synth:hips").refused(3, &["model.safetensors", "SHA-256"]);
    assert!(!dir.join("a.glb").exists());
    // A motion whose rotations and translations have different lengths.
    let motion = dir.join("uneven.safetensors");
    let header = r#"{"__metadata__":{"fps":"60","kind":"motion","motion":"m","softtissue":"1","subject":"s","take":"0"},"rotations":{"data_offsets":[0,576],"dtype":"F32","shape":[2,24,3]},"translations":{"data_offsets":[576,588],"dtype":"F32","shape":[1,3]}}"#;
    let mut file = (header.len() as u64).to_le_bytes().to_vec();
    file.extend(header.as_bytes());
    file.extend(vec![0u8; 588]);
    std::fs::write(&motion, file).expect("a motion");
    animate(&run.path.join("bundle"), &text(&motion)).refused(3, &["uneven.safetensors", "another count"]);
}

#[test]
fn inspect_tells_what_a_thing_is() {
    let run = tiny_run();
    let said = |path: &Path| softtissue(&["inspect", "--json", &text(path)]);
    let json = |path: &Path| -> serde_json::Value { serde_json::from_str(&said(path).fine().out).expect("JSON") };
    assert_eq!(json(&run.path)["what"], "run");
    assert_eq!(json(&run.path.join("bundle"))["what"], "bundle");
    let scans = tiny_scans();
    let made = scans.parent().expect("a parent");
    assert_eq!(json(&scans)["what"], "scan set");
    assert!(json(made)["what"].as_str().expect("a text").contains("generated scans"));
    assert!(json(&made.join("truth"))["what"].as_str().expect("a text").contains("truth"));
    assert_eq!(json(made.parent().expect("the cache"))["what"], "cache");
    // A broken list is named, and not taken for another kind of set.
    let broken = folder("broken-set");
    std::fs::write(broken.join("index.json"), r#"{"schema": 1, "kind": "scan"}"#).expect("a file");
    said(&broken).refused(3, &["index.json", "vertex_count"]);
    let basis = json(&run.path.join("stages/basis.safetensors"));
    assert_eq!(basis["what"], "tensor file");
    let missing = run.path.join("missing");
    said(&missing).refused(3, &["missing"]);
    assert!(command().arg("inspect").arg(&run.path).output().expect("the command starts").status.success());
}
