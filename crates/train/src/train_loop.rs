use crate::{Checkpoint, CheckpointFolder, Result, RunLog, State, TrainError, Trainee};
use serde::{Deserialize, Serialize};
use softtissue_monitor::Monitor;

/// How a stage is driven.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LoopConfig {
    /// Steps between validations; the best state by validation is the result. Default 200.
    pub validate_every: u64,
    /// Steps between checkpoints. Default 500.
    pub checkpoint_every: u64,
    /// Checkpoints kept. Default 2.
    pub keep_last: usize,
}

impl Default for LoopConfig {
    fn default() -> Self {
        Self { validate_every: 200, checkpoint_every: 500, keep_last: 2 }
    }
}

/// How a stage ended.
#[derive(Clone, Debug, PartialEq)]
pub struct Finished {
    /// Steps after which validation was best (0: the start).
    pub best_step: u64,
    /// Validation error there, mm.
    pub best_mm: f64,
}

/// Runs `steps` steps (from the newest checkpoint if there is one), keeps the best state by validation and
/// leaves the trainee in it.
///
/// Stopping by the monitor saves a checkpoint and returns [`TrainError::Stopped`]. A loss that is not finite
/// rolls back to the last saved state, saves that, and returns [`TrainError::Diverged`].
pub fn train_to_end(
    stage: &str,
    trainee: &mut dyn Trainee,
    steps: u64,
    config: &LoopConfig,
    folder: &CheckpointFolder,
    log: &RunLog,
    monitor: &dyn Monitor,
) -> Result<Finished> {
    let mut run = match folder.newest()? {
        Some(checkpoint) => {
            let path = folder.path_of(checkpoint.steps_done);
            let unfit = |e: TrainError| TrainError::Checkpoint { path, reason: format!("{e}; choose another --out") };
            trainee.load_state(&checkpoint.state).map_err(unfit)?;
            checkpoint
        }
        None => Checkpoint { steps_done: 0, state: snapshot(trainee), best: None },
    };
    log.rewind(stage, run.steps_done, run.best.is_some())?;
    monitor.begin(stage, steps, "steps");
    monitor.advance(run.steps_done, "");
    if run.best.is_none() {
        validate(stage, trainee, &mut run, log)?;
        let (_, start, _) = run.best.as_ref().expect("the first validation is the best so far");
        if !start.is_finite() {
            monitor.end();
            let step = run.steps_done;
            return Err(TrainError::Diverged { stage: stage.into(), step, loss: *start, rolled_back_to: step });
        }
    }
    while run.steps_done < steps {
        if monitor.should_stop() {
            run.state = snapshot(trainee);
            folder.save(&run)?;
            monitor.end();
            return Err(TrainError::Stopped { stage: stage.into(), step: run.steps_done });
        }
        let step = run.steps_done;
        let stats = trainee.step(step)?;
        if !stats.loss.is_finite() {
            monitor.end();
            let rolled_back_to = roll_back(trainee, folder, &run)?;
            return Err(TrainError::Diverged { stage: stage.into(), step, loss: stats.loss, rolled_back_to });
        }
        log.step(stage, step, &stats)?;
        run.steps_done += 1;
        let last = run.steps_done == steps;
        if last || run.steps_done.is_multiple_of(config.validate_every.max(1)) {
            validate(stage, trainee, &mut run, log)?;
        }
        if !last && run.steps_done.is_multiple_of(config.checkpoint_every.max(1)) {
            let state = snapshot(trainee);
            if state.values().any(|array| array.data.iter().any(|x| !x.is_finite())) {
                monitor.end();
                let rolled_back_to = roll_back(trainee, folder, &run)?;
                return Err(TrainError::Diverged { stage: stage.into(), step, loss: f64::NAN, rolled_back_to });
            }
            run.state = state;
            folder.save(&run)?;
        }
        let best = run.best.as_ref().map_or(f64::NAN, |b| b.1);
        monitor.advance(1, &format!("loss {:.4}, best validation {best:.3} mm", stats.loss));
    }
    monitor.end();
    let (best_step, best_mm, state) = run.best.expect("validated at least once");
    trainee.load_state(&state)?;
    Ok(Finished { best_step, best_mm })
}

/// Puts the trainee back into the last saved state (the start, if none was saved) and sees that it is on disk.
fn roll_back(trainee: &mut dyn Trainee, folder: &CheckpointFolder, run: &Checkpoint) -> Result<u64> {
    trainee.load_state(&run.state)?;
    if let Some(saved) = folder.newest()? {
        return Ok(saved.steps_done);
    }
    folder.save(&Checkpoint { steps_done: 0, state: run.state.clone(), best: None })?;
    Ok(0)
}

fn validate(stage: &str, trainee: &mut dyn Trainee, run: &mut Checkpoint, log: &RunLog) -> Result<()> {
    let mm = trainee.validate()?;
    log.validation(stage, run.steps_done, mm)?;
    // NaN never wins, and the first of equals stays.
    if run.best.as_ref().is_none_or(|best| mm < best.1) {
        run.best = Some((run.steps_done, mm, snapshot(trainee)));
    }
    Ok(())
}

fn snapshot(trainee: &dyn Trainee) -> State {
    trainee.state().into_iter().map(|array| (array.name.clone(), array)).collect()
}
