//! The player of softtissue for Python: NumPy arrays in, NumPy arrays out.

use glam::Vec3;
use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use softtissue_body::{Pose, Region};
use softtissue_bundle as core;
use softtissue_geometry::Frames;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

fn refused(error: core::BundleError) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// A bundle of `softtissue train`: Bundle(folder). Checked whole when it is opened.
#[pyclass(frozen)]
struct Bundle(Arc<core::Bundle>);

#[pymethods]
impl Bundle {
    #[new]
    fn new(folder: PathBuf) -> PyResult<Self> {
        Ok(Self(Arc::new(core::Bundle::read(&folder).map_err(refused)?)))
    }
    /// Frames a second of the training motions.
    #[getter]
    fn fps(&self) -> f32 {
        self.0.descriptor.fps
    }
    /// Name of the method.
    #[getter]
    fn method(&self) -> &str {
        &self.0.info.method
    }
    /// Names of the joints, in the order of a pose.
    #[getter]
    fn joints(&self) -> Vec<String> {
        self.0.body.skeleton.names.clone()
    }
    /// Parent of each joint; None for the root.
    #[getter]
    fn parents(&self) -> Vec<Option<u8>> {
        self.0.body.skeleton.parents.clone()
    }
    /// Vertices of the body.
    #[getter]
    fn vertex_count(&self) -> usize {
        self.0.body.vertex_count()
    }
    /// Shape coefficients of the body.
    #[getter]
    fn shape_count(&self) -> usize {
        self.0.body.shape_count()
    }
    /// Triangles [F, 3], counter-clockwise from outside.
    #[getter]
    fn faces<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        let faces = &self.0.body.topology.faces;
        PyArray1::from_slice(py, faces.as_flattened()).reshape([faces.len(), 3])
    }
    /// Rest mesh [V, 3] of a shape, metres.
    #[pyo3(signature = (shape = vec![]))]
    fn rest_mesh<'py>(&self, py: Python<'py>, shape: Vec<f32>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let player = core::Player::new(&*self.0, &shape).map_err(refused)?;
        points(py, &player.shaped().vertices)
    }
    fn __repr__(&self) -> String {
        let (method, vertices) = (self.method(), self.vertex_count());
        format!("Bundle(method={method:?}, vertices={vertices}, fps={})", self.fps())
    }
}

/// Plays a bundle on one body, frame by frame: Player(bundle, shape=[]). Whatever comes in, what comes out is finite;
/// `report` tells what had to be done for it.
#[pyclass]
struct Player {
    player: core::Player<Arc<core::Bundle>>,
    controls: core::Controls,
    /// Of the newest frame, by name.
    report: Vec<&'static str>,
}

#[pymethods]
impl Player {
    #[new]
    #[pyo3(signature = (bundle, shape = vec![]))]
    fn new(bundle: &Bundle, shape: Vec<f32>) -> PyResult<Self> {
        let player = core::Player::new(Arc::clone(&bundle.0), &shape).map_err(refused)?;
        Ok(Self { player, controls: core::Controls::default(), report: vec![] })
    }

    /// Changes what was learned, everywhere or in a region ("belly", "breast", ...), and starts over: factors of the
    /// displacement, of the time of the answer and of its damping, a delay in seconds, and how much heavier the person is
    /// whose flesh it is.
    #[pyo3(signature = (region = "everywhere", *, gain = 1.0, softness = 1.0, damping = 1.0, lag = 0.0, mass = 0.0))]
    fn control(&mut self, region: &str, gain: f32, softness: f32, damping: f32, lag: f32, mass: f32) -> PyResult<()> {
        let control = core::Control { gain, softness, damping, lag, mass };
        let mut controls = self.controls.clone();
        if region == "everywhere" {
            controls.everywhere = control;
        } else {
            let named = self::region(region, "everywhere, ")?;
            controls.regions.retain(|(r, _)| *r != named);
            controls.regions.push((named, control));
        }
        self.player.set_controls(&controls).map_err(refused)?;
        self.controls = controls;
        Ok(())
    }

    /// Level of detail, from the next frame on: the displacements of so many components of the basis, the most important first,
    /// and regions that are left rigid ("head", "hands", ...). Never starts over.
    #[pyo3(signature = (components = None, still = vec![]))]
    fn detail(&mut self, components: Option<usize>, still: Vec<String>) -> PyResult<()> {
        let still = still.iter().map(|name| region(name, "")).collect::<PyResult<_>>()?;
        self.player.set_detail(&core::Detail { components, still }).map_err(refused)
    }

    /// Fades the deltas out where the motion is unlike all that the bundle knows, and in again where it is not: below a trust of
    /// 0 to 1 (0 never fades) that has lasted for `patience` seconds, over so many seconds.
    #[pyo3(signature = (below = 0.5, patience = 0.2, seconds = 0.5))]
    fn fade(&mut self, below: f32, patience: f32, seconds: f32) -> PyResult<()> {
        self.player.set_fade(Some(core::Fade { below, patience, seconds })).map_err(refused)
    }

    /// Starts over in the steady state of a pose, as if the body had stood in it for so many seconds: the motion that follows
    /// may begin in mid-movement and makes no jolt.
    #[pyo3(signature = (rotations, translation, seconds = 3.0))]
    fn pre_roll<'py>(
        &mut self,
        rotations: PyReadonlyArray2<'py, f32>,
        translation: PyReadonlyArray1<'py, f32>,
        seconds: f32,
    ) -> PyResult<()> {
        let rotations = vectors(rotations.as_array().shape(), rotations.as_array().iter())?;
        let translation = vectors(&[1, translation.as_array().len()], translation.as_array().iter())?[0];
        self.report = names(&self.player.pre_roll(Pose { rotations: &rotations, translation }, seconds));
        Ok(())
    }

    /// Forgets the motion: the next pose is a first one.
    fn reset(&mut self) {
        self.player.reset();
        self.report.clear();
    }

    /// One frame: joint rotations [J, 3] as axis times angle in radians, each in its parent's frame, and the root's
    /// translation [3] in metres. Plays on by dt seconds, or by one frame of the bundle's rate without it. Returns the posed
    /// vertices [V, 3] in metres.
    #[pyo3(signature = (rotations, translation, dt = None))]
    fn step<'py>(
        &mut self,
        py: Python<'py>,
        rotations: PyReadonlyArray2<'py, f32>,
        translation: PyReadonlyArray1<'py, f32>,
        dt: Option<f32>,
    ) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let rotations = vectors(rotations.as_array().shape(), rotations.as_array().iter())?;
        let translation = vectors(&[1, translation.as_array().len()], translation.as_array().iter())?[0];
        let pose = Pose { rotations: &rotations, translation };
        let report = match dt {
            Some(dt) => self.player.advance(pose, dt),
            None => self.player.step(pose),
        };
        self.report = names(&report);
        points(py, self.player.vertices())
    }

    /// The same as `step` without dt, and where its time went: milliseconds by part ("skinning", "descriptor", "encoder",
    /// "regressor", "decoder", "feedback"; those that the model has) and "whole". Vertices are computed, not copied out.
    fn timed_step<'py>(
        &mut self,
        rotations: PyReadonlyArray2<'py, f32>,
        translation: PyReadonlyArray1<'py, f32>,
    ) -> PyResult<BTreeMap<&'static str, f64>> {
        let rotations = vectors(rotations.as_array().shape(), rotations.as_array().iter())?;
        let translation = vectors(&[1, translation.as_array().len()], translation.as_array().iter())?[0];
        let (report, times) = self.player.timed_step(Pose { rotations: &rotations, translation });
        self.report = names(&report);
        let parts = core::StepPart::ALL.into_iter().filter_map(|part| Some((part.name(), times.part(part)?)));
        Ok(parts.chain([("whole", times.whole)]).map(|(name, time)| (name, 1e3 * time.as_secs_f64())).collect())
    }

    /// Deltas [T, V, 3] in metres of a whole motion from its start: rotations [T, J, 3] and translations [T, 3].
    fn rollout<'py>(
        &mut self,
        py: Python<'py>,
        rotations: PyReadonlyArray3<'py, f32>,
        translations: PyReadonlyArray2<'py, f32>,
    ) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let joints = rotations.as_array().shape()[1].max(1);
        let frames = Frames::from_points(joints, vectors(rotations.as_array().shape(), rotations.as_array().iter())?);
        let translations = vectors(translations.as_array().shape(), translations.as_array().iter())?;
        let deltas = self.player.rollout(&frames, &translations).map_err(refused)?;
        let numbers = deltas.to_numbers();
        PyArray1::from_vec(py, numbers).reshape([deltas.len(), deltas.points_per_frame(), 3])
    }

    /// Deltas [V, 3] of the newest frame in the rest frame, metres.
    #[getter]
    fn deltas<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        points(py, self.player.deltas())
    }
    /// The descriptor's features [D] of the newest frame: what the ONNX network takes.
    #[getter]
    fn features<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f32>> {
        PyArray1::from_slice(py, self.player.features())
    }
    /// The few numbers [L] behind the newest deltas.
    #[getter]
    fn latent<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f32>> {
        PyArray1::from_slice(py, self.player.latent())
    }
    /// What the newest step had to do to stay sane, e.g. ["teleported"]; empty where all was well.
    #[getter]
    fn report(&self) -> Vec<&'static str> {
        self.report.clone()
    }
    /// Bytes of weights that a frame reads once, in full detail.
    #[getter]
    fn weight_bytes(&self) -> usize {
        self.player.weight_bytes()
    }
    /// Trust in the newest frame: 1 where motion and body are like those of the training, 0 far from them.
    #[getter]
    fn trust(&self) -> f32 {
        self.player.trust()
    }
    /// Seconds between a pose and its deltas: 0 unless the model looks ahead.
    #[getter]
    fn latency(&self) -> f32 {
        self.player.latency()
    }
    /// Frames between a pose and its deltas, where the model looks ahead.
    #[getter]
    fn delay_frames(&self) -> usize {
        self.player.delay_frames()
    }
}

/// The region of a name; `beside` is what else could have been said.
fn region(name: &str, beside: &str) -> PyResult<Region> {
    let known = || Region::ALL.map(Region::name).join(", ");
    let region = Region::ALL.into_iter().find(|r| r.name() == name);
    region.ok_or_else(|| PyValueError::new_err(format!("{name:?} is no region; choose {beside}{}", known())))
}

fn names(report: &core::StepReport) -> Vec<&'static str> {
    let told = [
        (report.pose_held, "pose held"),
        (report.teleported, "teleported"),
        (report.features_clipped > 0, "features clipped"),
        (report.restarted, "restarted"),
        (report.time_ignored, "time ignored"),
        (report.waiting, "waiting"),
    ];
    told.into_iter().filter(|(is, _)| *is).map(|(_, name)| name).collect()
}

/// Vectors of an array whose last extent is 3.
fn vectors<'a>(shape: &[usize], numbers: impl Iterator<Item = &'a f32>) -> PyResult<Vec<Vec3>> {
    if shape.last() != Some(&3) {
        return Err(PyValueError::new_err(format!("an array of shape {shape:?}: its last extent must be 3")));
    }
    let numbers: Vec<f32> = numbers.copied().collect();
    Ok(numbers.as_chunks::<3>().0.iter().copied().map(Vec3::from_array).collect())
}

fn points<'py>(py: Python<'py>, points: &[Vec3]) -> PyResult<Bound<'py, PyArray2<f32>>> {
    let numbers: Vec<f32> = points.iter().flat_map(|p| p.to_array()).collect();
    PyArray1::from_vec(py, numbers).reshape([points.len(), 3])
}

/// Soft tissue on skeletal animation: Bundle and Player.
#[pymodule]
fn softtissue(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Bundle>()?;
    module.add_class::<Player>()?;
    module.add("__version__", env!("CARGO_PKG_VERSION"))
}
