//! `export`: the network of a bundle for other programs, the bundle in fewer bits, and the page that plays it.

use crate::args::ExportArgs;
use crate::exit::UsageError;
use crate::signals::Signals;
use crate::terminal::Terminal;
use crate::verbs::{body_shape, page, precision};
use anyhow::Result;
use softtissue_bundle::Bundle;
use softtissue_export::{OnnxForm, write_onnx};

/// Runs the verb.
pub fn run(args: &ExportArgs, signals: &Signals) -> Result<()> {
    if args.web.is_none() && !args.motions.chosen.is_empty() {
        return Err(UsageError("--motion is for a page; write --web DIR too".into()).into());
    }
    // What this build cannot do is said before anything is done.
    let site = match &args.web {
        Some(dir) => Some((dir, page::site(&args.bundle, &args.motions, &Terminal::new(signals.clone(), false))?)),
        None => None,
    };
    let wanted = args.precision.as_deref().map(precision::parse).transpose()?;
    let bundle = Bundle::read(&args.bundle)?;
    let beta = body_shape::of(&args.body, &bundle)?;
    for (path, form) in [(&args.onnx, OnnxForm::Fused), (&args.plain_onnx, OnnxForm::Plain)] {
        let Some(path) = path else { continue };
        write_onnx(path, &bundle, &beta, form)?;
        let features = bundle.model.feature_count();
        crate::print_line(&format!(
            "{}: {features} features in, {} vertices out",
            path.display(),
            bundle.body.vertex_count()
        ));
    }
    if let (Some(precision), Some(dir)) = (wanted, &args.out) {
        precision::write(&args.bundle, &bundle, precision, dir, &Terminal::new(signals.clone(), false))?;
    }
    if let Some((dir, site)) = site {
        crate::print_line(&site.write(dir)?.display().to_string());
    }
    Ok(())
}
