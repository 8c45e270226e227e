//! `export`: the network of a bundle for other programs.

use crate::args::ExportArgs;
use crate::verbs::body_shape;
use anyhow::Result;
use softtissue_bundle::Bundle;
use softtissue_export::{OnnxForm, write_onnx};

/// Runs the verb.
pub fn run(args: &ExportArgs) -> Result<()> {
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
    Ok(())
}
