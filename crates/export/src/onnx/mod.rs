//! The network of a bundle as ONNX.

mod graph;
mod proto;
mod recurrent;

use crate::{ExportError, Result};
use graph::Graph;
use prost::Message;
use proto::{ModelProto, OperatorSetIdProto, StringStringEntryProto};
use serde_json::json;
use softtissue_bundle::Bundle;
use softtissue_store::write_atomic;
use std::path::Path;

/// Version of the format, and of its operators: old enough for every runtime in use.
const IR_VERSION: i64 = 8;
const OPERATORS: i64 = 17;

/// How the recurrent unit is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OnnxForm {
    /// As ONNX's `GRU`, which runtimes compute in one go.
    Fused,
    /// Out of matrix products, sigmoids and hyperbolic tangents, for engines without a recurrent operator.
    Plain,
}

/// Writes the network of a bundle for one body of shape `beta`: one frame of the descriptor's features in, deltas out.
///
/// | value | | |
/// |---|---|---|
/// | `features` | in `[batch, D]` | what the player's descriptor makes of a pose ([`softtissue_bundle::Player::features`]) |
/// | `memory`, `hidden` | in `[batch, M]`, `[batch, H]` | zero before the first frame, then what came out of the last; each only where the model has it |
/// | `deltas` | out `[batch, V, 3]` | metres, rest frame |
/// | `latent` | out `[batch, L]` | |
/// | `memory_out`, `hidden_out` | out | for the next frame |
///
/// # Errors
/// Another kind of model than a recurrent one, or the disk.
pub fn write_onnx(path: &Path, bundle: &Bundle, beta: &[f32], form: OnnxForm) -> Result<()> {
    let Some(model) = bundle.model.recurrent() else {
        return Err(ExportError::Model { method: bundle.info.method.clone() });
    };
    let mut graph = Graph::default();
    recurrent::build(&mut graph, model, beta, form);
    graph.proto.name = "softtissue".into();
    let metadata = [
        ("method", bundle.info.method.clone()),
        ("licence", bundle.info.licence.clone()),
        ("frames_per_second", bundle.descriptor.fps.to_string()),
        ("shape", json!(beta).to_string()),
        ("topology", bundle.body.topology.hash()),
        ("descriptor", serde_json::to_string(&bundle.descriptor).unwrap_or_default()),
    ];
    let model = ModelProto {
        ir_version: IR_VERSION,
        producer_name: "softtissue".into(),
        producer_version: env!("CARGO_PKG_VERSION").into(),
        doc_string: "One frame of soft tissue: features of a pose and the state before it to deltas in metres.".into(),
        graph: Some(graph.proto),
        opset_import: vec![OperatorSetIdProto { domain: String::new(), version: OPERATORS }],
        metadata_props: metadata.map(|(key, value)| StringStringEntryProto { key: key.into(), value }).to_vec(),
    };
    Ok(write_atomic(path, |w| w.write_all(&model.encode_to_vec()))?)
}
