use super::proto::{
    AttributeProto, AttributeType, DataType, Dimension, Extent, GraphProto, NodeProto, TensorProto, TensorShapeProto,
    TensorType, TypeProto, ValueInfoProto,
};
use softtissue_bundle::{Linear, Matrix};

/// The first extent of every input and output: characters side by side.
const BATCH: &str = "batch";

/// A graph under construction. Values are known by name; a node's value gets the node's name.
#[derive(Default)]
pub(super) struct Graph {
    pub(super) proto: GraphProto,
}

impl Graph {
    /// An input `[batch, extents...]` of f32.
    pub(super) fn input(&mut self, name: &str, extents: &[usize], about: &str) -> String {
        self.proto.input.push(value_info(name, extents, about));
        name.to_owned()
    }

    /// Makes a value an output `[batch, extents...]` under its own name.
    pub(super) fn output(&mut self, name: &str, extents: &[usize], about: &str) {
        self.proto.output.push(value_info(name, extents, about));
    }

    /// Constant numbers.
    pub(super) fn numbers(&mut self, name: &str, dims: &[usize], numbers: &[f32]) -> String {
        assert_eq!(dims.iter().product::<usize>(), numbers.len(), "{name}");
        self.constant(name, dims, DataType::Float, bytemuck::cast_slice(numbers).to_vec())
    }

    /// Constant whole numbers.
    pub(super) fn indices(&mut self, name: &str, indices: &[i64]) -> String {
        self.constant(name, &[indices.len()], DataType::Int64, bytemuck::cast_slice(indices).to_vec())
    }

    /// A node with one output that is called `name`.
    pub(super) fn node(&mut self, name: &str, operator: &str, inputs: &[&str], attributes: &[(&str, i64)]) -> String {
        self.node_with(name, operator, inputs, &[name], attributes);
        name.to_owned()
    }

    /// A node with these outputs.
    pub(super) fn node_with(
        &mut self,
        name: &str,
        operator: &str,
        inputs: &[&str],
        outputs: &[&str],
        attributes: &[(&str, i64)],
    ) {
        let own = |names: &[&str]| names.iter().map(|n| (*n).to_owned()).collect();
        let attribute = |(name, i): &(&str, i64)| AttributeProto {
            name: (*name).to_owned(),
            i: *i,
            r#type: AttributeType::Int as i32,
        };
        self.proto.node.push(NodeProto {
            input: own(inputs),
            output: own(outputs),
            name: name.to_owned(),
            op_type: operator.to_owned(),
            attribute: attributes.iter().map(attribute).collect(),
        });
    }

    /// `x W^T + b`, `[batch, in]` to `[batch, out]`.
    pub(super) fn linear(&mut self, name: &str, layer: &Linear, x: &str) -> String {
        let product = self.product(&format!("{name}.product"), &layer.weight, x);
        let bias = self.numbers(&format!("{name}.bias"), &[layer.bias.len()], &layer.bias);
        self.node(name, "Add", &[&product, &bias], &[])
    }

    /// `x W^T`.
    pub(super) fn product(&mut self, name: &str, weight: &Matrix, x: &str) -> String {
        let (rows, cols) = (weight.rows(), weight.cols());
        let numbers = weight.numbers();
        let numbers = &numbers;
        let transposed: Vec<f32> = (0..cols).flat_map(|c| (0..rows).map(move |r| numbers[r * cols + c])).collect();
        let weight = self.numbers(&format!("{name}.weight"), &[cols, rows], &transposed);
        self.node(name, "MatMul", &[x, &weight], &[])
    }

    fn constant(&mut self, name: &str, dims: &[usize], data_type: DataType, raw_data: Vec<u8>) -> String {
        let dims = dims.iter().map(|d| *d as i64).collect();
        self.proto.initializer.push(TensorProto { dims, data_type: data_type as i32, name: name.to_owned(), raw_data });
        name.to_owned()
    }
}

fn value_info(name: &str, extents: &[usize], about: &str) -> ValueInfoProto {
    let mut dim = vec![Dimension { value: Some(Extent::Free(BATCH.to_owned())) }];
    dim.extend(extents.iter().map(|e| Dimension { value: Some(Extent::Fixed(*e as i64)) }));
    let tensor_type = TensorType { elem_type: DataType::Float as i32, shape: Some(TensorShapeProto { dim }) };
    let r#type = Some(TypeProto { tensor_type: Some(tensor_type) });
    ValueInfoProto { name: name.to_owned(), r#type, doc_string: about.to_owned() }
}
