use crate::{NamedArray, Result, State, TrainError};
use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::tensor::{Gradients, Tensor, TensorData};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use softtissue_model::host;
use std::collections::BTreeMap;

/// Adam's constants (Kingma and Ba 2015).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct AdamConfig {
    /// Memory of the mean gradient, a step. Default 0.9.
    pub beta_1: f64,
    /// Memory of the mean squared gradient, a step. Default 0.999.
    pub beta_2: f64,
    /// Keeps the quotient finite. Default 1e-8; in the units of the gradient.
    pub epsilon: f64,
}

impl Default for AdamConfig {
    fn default() -> Self {
        Self { beta_1: 0.9, beta_2: 0.999, epsilon: 1e-8 }
    }
}

/// Gradients by the path of the parameter in its module, e.g. `decoder.lift.weight`.
pub type GradientMap = BTreeMap<String, Vec<f32>>;

/// Adam in one pass over each parameter, on the host. The plain form is about twelve passes, which costs more than
/// a small network's forward and backward together.
#[derive(Clone, Debug)]
pub struct Adam {
    config: AdamConfig,
    steps: u64,
    moments: BTreeMap<String, Moments>,
}

#[derive(Clone, Debug)]
struct Moments {
    shape: Vec<usize>,
    first: Vec<f32>,
    second: Vec<f32>,
}

/// Numbers a thread takes at a time.
const CHUNK: usize = 1 << 14;

impl Adam {
    /// Without memory.
    pub fn new(config: AdamConfig) -> Self {
        Self { config, steps: 0, moments: BTreeMap::new() }
    }

    /// One step on every parameter of `module` that `gradients` names; the others stay as they are.
    pub fn step<M: Module>(&mut self, module: M, gradients: &GradientMap, learning_rate: f64) -> M {
        self.steps += 1;
        let mut update = Update { adam: self, gradients, learning_rate, path: Vec::new() };
        module.map(&mut update)
    }

    /// One step on `weights [shape]`, the parameter `name`. The count of steps is the caller's to raise.
    fn update(&mut self, name: &str, shape: &[usize], weights: &mut [f32], gradient: &[f32], learning_rate: f64) {
        assert_eq!(weights.len(), gradient.len(), "gradient of {name}");
        let moments = self.moments.entry(name.to_owned()).or_insert_with(|| Moments {
            shape: shape.to_vec(),
            first: vec![0.0; gradient.len()],
            second: vec![0.0; gradient.len()],
        });
        let AdamConfig { beta_1, beta_2, epsilon } = self.config;
        let steps = self.steps as f64;
        let root = (1.0 - beta_2.powf(steps)).sqrt();
        let rate = (learning_rate * root / (1.0 - beta_1.powf(steps))) as f32;
        let floor = (epsilon * root) as f32;
        let (keep_1, add_1) = (beta_1 as f32, (1.0 - beta_1) as f32);
        let (keep_2, add_2) = (beta_2 as f32, (1.0 - beta_2) as f32);
        weights
            .par_chunks_mut(CHUNK)
            .zip(gradient.par_chunks(CHUNK))
            .zip(moments.first.par_chunks_mut(CHUNK).zip(moments.second.par_chunks_mut(CHUNK)))
            .for_each(|((weights, gradient), (first, second))| {
                for (((w, g), m), v) in weights.iter_mut().zip(gradient).zip(first).zip(second) {
                    *m = keep_1 * *m + add_1 * g;
                    *v = keep_2 * *v + add_2 * (g * g);
                    *w -= rate * *m / (v.sqrt() + floor);
                }
            });
    }

    /// Moments and the count of steps, every name after `adam.`.
    pub fn state(&self) -> Vec<NamedArray> {
        // A count up to 2^24 is exact in f32, and no stage is near that long.
        let mut arrays = vec![NamedArray { name: "adam.steps".into(), shape: vec![1], data: vec![self.steps as f32] }];
        for (name, m) in &self.moments {
            for (kind, data) in [("first", &m.first), ("second", &m.second)] {
                let name = format!("adam.{kind}.{name}");
                arrays.push(NamedArray { name, shape: m.shape.clone(), data: data.clone() });
            }
        }
        arrays
    }

    /// Takes back what [`Adam::state`] gave.
    pub fn load_state(&mut self, state: &State) -> Result<()> {
        let steps = array(state, "adam.steps", &[1])?.data[0];
        let mut moments = BTreeMap::new();
        for (key, first) in state {
            if let Some(name) = key.strip_prefix("adam.first.") {
                let second = array(state, &format!("adam.second.{name}"), &first.shape)?;
                let (first_data, second_data) = (first.data.clone(), second.data.clone());
                let entry = Moments { shape: first.shape.clone(), first: first_data, second: second_data };
                moments.insert(name.to_owned(), entry);
            }
        }
        self.steps = steps as u64;
        self.moments = moments;
        Ok(())
    }
}

/// The array `name` of `state`, which must have `shape`.
fn array<'a>(state: &'a State, name: &str, shape: &[usize]) -> Result<&'a NamedArray> {
    let array = state.get(name).ok_or_else(|| {
        TrainError::Config(format!("the state holds no {name}: it is of another network; start the stage anew"))
    })?;
    if array.shape != shape || array.data.len() != shape.iter().product::<usize>() {
        return Err(TrainError::Config(format!(
            "{name} has shape {:?} in the state and {shape:?} in the network: resume with the configuration it was saved \
             under",
            array.shape
        )));
    }
    Ok(array)
}

/// Gradients of a module's parameters after `backward`, on the host.
pub fn module_gradients<M: Module>(module: &M, gradients: &mut Gradients) -> GradientMap {
    let mut collect = Collect { gradients, found: GradientMap::new(), path: Vec::new() };
    module.visit(&mut collect);
    collect.found
}

/// A module's parameters by path, on the host.
pub fn module_state<M: Module>(module: &M) -> Vec<NamedArray> {
    let mut read = Read { arrays: Vec::new(), path: Vec::new() };
    module.visit(&mut read);
    read.arrays
}

/// `module` with the parameters of `state`; every one must be there in its shape.
pub fn load_module<M: Module>(module: M, state: &State) -> Result<M> {
    let mut load = Load { state, path: Vec::new(), error: None };
    let module = module.map(&mut load);
    load.error.map_or(Ok(module), Err)
}

struct Collect<'a> {
    gradients: &'a mut Gradients,
    found: GradientMap,
    path: Vec<String>,
}

struct Read {
    arrays: Vec<NamedArray>,
    path: Vec<String>,
}

struct Update<'a> {
    adam: &'a mut Adam,
    gradients: &'a GradientMap,
    learning_rate: f64,
    path: Vec<String>,
}

struct Load<'a> {
    state: &'a State,
    path: Vec<String>,
    error: Option<TrainError>,
}

/// Keeps the path of the parameter being visited.
macro_rules! follow_path {
    () => {
        fn enter_module(&mut self, name: &str, _container: &str) {
            self.path.push(name.to_owned());
        }
        fn exit_module(&mut self, _name: &str, _container: &str) {
            self.path.pop();
        }
    };
}

impl ModuleVisitor for Collect<'_> {
    follow_path!();
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        if let Some(gradient) = param.val().grad_remove(self.gradients) {
            self.found.insert(self.path.join("."), host(gradient));
        }
    }
}

impl ModuleVisitor for Read {
    follow_path!();
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        let shape = param.dims().to_vec();
        self.arrays.push(NamedArray { name: self.path.join("."), shape, data: host(param.val()) });
    }
}

impl ModuleMapper for Update<'_> {
    follow_path!();
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let name = self.path.join(".");
        let Some(gradient) = self.gradients.get(&name) else { return param };
        let (adam, rate) = (&mut *self.adam, self.learning_rate);
        replace(param, |shape, weights| adam.update(&name, shape, weights, gradient, rate))
    }
}

impl ModuleMapper for Load<'_> {
    follow_path!();
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        match array(self.state, &self.path.join("."), &param.dims()) {
            Ok(array) => replace(param, |_, weights| weights.copy_from_slice(&array.data)),
            Err(error) => {
                self.error.get_or_insert(error);
                param
            }
        }
    }
}

/// The parameter with its numbers changed on the host; device and training state stay.
fn replace<const D: usize>(param: Param<Tensor<D>>, change: impl FnOnce(&[usize], &mut [f32])) -> Param<Tensor<D>> {
    let (id, tensor, mapper) = param.consume();
    let (device, trained, shape) = (tensor.device(), tensor.is_require_grad(), tensor.dims());
    let mut weights = host(tensor);
    change(&shape, &mut weights);
    let tensor = Tensor::from_data(TensorData::new(weights, shape), &device).set_require_grad(trained);
    Param::from_mapped_value(id, tensor, mapper)
}
