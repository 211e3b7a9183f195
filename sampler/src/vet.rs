//! Is this graph fit for tract? A stranger's ONNX file can make its parser or an operator panic, and
//! its C interface turns a panic into an abort; or it can ask for more memory than there is. So each
//! graph is read, measured and run once here first.

use shakedown_objects::io::caught;
use tract_onnx::pb::{ModelProto, TensorProto};
use tract_onnx::prelude::*;

/// Most numbers in one tensor, and in all tensors of a graph together.
const NUMBERS_MAX: usize = 1 << 28;
/// Operators whose second or first input is a shape.
const SHAPED: [&str; 6] = [
    "ConstantOfShape",
    "Expand",
    "Reshape",
    "Tile",
    "Resize",
    "Upsample",
];

/// Reads a graph and runs it on zeros if `shape_of` knows all its inputs; returns how many numbers its
/// first output has, if it ran. Its tensors are measured with open dimensions of `batch`.
///
/// # Errors
/// A graph that tract refuses or panics on, a tensor beyond all measure. A failing run is left to whoever
/// knows the shapes that were asked for.
pub(crate) fn vet(
    bytes: &[u8],
    batch: usize,
    shape_of: impl Fn(&str) -> Option<Vec<usize>>,
) -> Result<Option<usize>, String> {
    let vetted = caught(|| {
        let onnx = onnx();
        let proto = onnx.proto_model_for_read(&mut &*bytes).map_err(unusable)?;
        check_names(&proto)?;
        measure_constants(&proto, bytes.len())?;
        let inputs: Option<Vec<(String, Tensor)>> = proto.graph.as_ref().and_then(|graph| {
            let input = |i: &tract_onnx::pb::ValueInfoProto| {
                let zeros = Tensor::zero::<f32>(&shape_of(&i.name)?).ok()?;
                Some((i.name.clone(), zeros))
            };
            graph.input.iter().map(input).collect()
        });
        let parsed = onnx.parse(&proto, None).map_err(unusable)?;
        let typed = parsed.model.into_typed().map_err(unusable)?;
        measure(&typed, batch)?;
        let Some(inputs) = inputs else {
            return Ok(None);
        };
        Ok(run(typed, inputs).ok())
    });
    vetted.unwrap_or_else(|panic| Err(unusable(panic)))
}

fn unusable(why: impl std::fmt::Display) -> String {
    format!("not a usable ONNX graph: {why}")
}

/// A name with a zero byte cannot pass through the C interface, not even in an error.
fn check_names(proto: &ModelProto) -> Result<(), String> {
    let Some(graph) = &proto.graph else {
        return Ok(());
    };
    let values = graph
        .input
        .iter()
        .chain(&graph.output)
        .chain(&graph.value_info);
    let nodes = graph.node.iter().flat_map(|n| {
        let of_node = [&n.name, &n.op_type, &n.domain];
        let attributes = n.attribute.iter().map(|a| &a.name);
        let tensors = n.input.iter().chain(&n.output);
        of_node.into_iter().chain(tensors).chain(attributes)
    });
    let mut names = (values.map(|v| &v.name))
        .chain(graph.initializer.iter().map(|t| &t.name))
        .chain(nodes)
        .chain([&graph.name]);
    match names.find(|n| n.contains('\0')) {
        Some(name) => Err(unusable(format!("the name {name:?} holds a zero byte"))),
        None => Ok(()),
    }
}

fn run(typed: TypedModel, inputs: Vec<(String, Tensor)>) -> TractResult<usize> {
    let names = inputs.iter().map(|(name, _)| name);
    let plan = typed
        .into_optimized()?
        .with_input_names(names)?
        .into_runnable()?;
    let outputs = plan.run(inputs.into_iter().map(|(_, t)| t.into_tvalue()).collect())?;
    Ok(outputs.first().map_or(0, |t| t.len()))
}

/// No constant states more numbers than the file can hold, and none is the shape of a monster.
fn measure_constants(proto: &ModelProto, file_bytes: usize) -> Result<(), String> {
    let Some(graph) = &proto.graph else {
        return Ok(());
    };
    let attributes = graph.node.iter().flat_map(|n| {
        let tensors = n.attribute.iter().filter_map(|a| a.t.as_ref());
        tensors.map(|t| (n.output.first().map_or("", String::as_str), t))
    });
    let initializers = graph.initializer.iter().map(|t| (t.name.as_str(), t));
    for (name, tensor) in initializers.chain(attributes) {
        let numbers = product(&tensor.dims);
        if numbers.is_none_or(|n| n > file_bytes) {
            return Err(format!(
                "constant {name:?} states the shape {:?}, more than the file holds",
                tensor.dims
            ));
        }
        let shapes = graph.node.iter().any(|n| {
            SHAPED.contains(&n.op_type.as_str()) && n.input.iter().any(|input| input == name)
        });
        let shape = integers(tensor);
        let positive: Vec<i64> = shape.into_iter().filter(|d| *d > 0).collect();
        if shapes && product(&positive).is_none_or(|n| n > NUMBERS_MAX) {
            return Err(format!("{name:?} makes a tensor of shape {positive:?}"));
        }
    }
    Ok(())
}

fn product(dims: &[i64]) -> Option<usize> {
    dims.iter().try_fold(1usize, |product, d| {
        product.checked_mul(usize::try_from(*d).ok()?)
    })
}

fn integers(tensor: &TensorProto) -> Vec<i64> {
    let raw = tensor.raw_data.chunks_exact(8);
    let raw = raw.map(|b| i64::from_le_bytes(b.try_into().expect("eight bytes")));
    let small = tensor.int32_data.iter().map(|x| i64::from(*x));
    let is_integer = [6, 7].contains(&tensor.data_type);
    let all = tensor.int64_data.iter().copied().chain(small).chain(raw);
    all.filter(|_| is_integer).collect()
}

/// All tensors of the graph together stay within bounds.
fn measure(model: &TypedModel, batch: usize) -> Result<(), String> {
    let mut total = 0usize;
    for node in &model.nodes {
        for outlet in &node.outputs {
            let dims = outlet.fact.shape.iter();
            let numbers = dims.fold(1usize, |n, d| {
                n.saturating_mul(d.to_i64().map_or(batch, |d| d.max(0) as usize))
            });
            total = total.saturating_add(numbers);
            if total > NUMBERS_MAX {
                return Err(format!(
                    "{:?} makes the graph's tensors exceed {NUMBERS_MAX} numbers",
                    node.name
                ));
            }
        }
    }
    Ok(())
}
