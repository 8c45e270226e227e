//! Whose body is meant: shape coefficients, and a body mass index on top of them.

use crate::args::ShapeArgs;
use crate::exit::UsageError;
use anyhow::Result;
use softtissue_body::BodyBuild;
use softtissue_bundle::Bundle;

/// Largest shape coefficient that is a body.
const LARGEST_COEFFICIENT: f32 = 10.0;

/// The shape that was asked for; the mean shape where nothing was.
pub fn of(args: &ShapeArgs, bundle: &Bundle) -> Result<Vec<f32>> {
    let beta = match &args.shape {
        Some(text) => parse("--shape", text, bundle)?,
        None => vec![0.0; bundle.body.shape_count()],
    };
    match args.bmi {
        Some(bmi) => of_weight(&beta, bmi, bundle),
        None => Ok(beta),
    }
}

/// Coefficients that `option` gave.
pub fn parse(option: &str, text: &str, bundle: &Bundle) -> Result<Vec<f32>> {
    let beta = text
        .split(',')
        .map(|b| b.trim().parse::<f32>().ok().filter(|b| b.is_finite() && b.abs() <= LARGEST_COEFFICIENT))
        .collect::<Option<Vec<f32>>>()
        .ok_or_else(|| {
            UsageError(format!("{option} {text:?}: write numbers between -10 and 10, separated by commas"))
        })?;
    if beta.len() > bundle.body.shape_count() {
        let (given, has) = (beta.len(), bundle.body.shape_count());
        return Err(UsageError(format!("{option} has {given} numbers, but the body has {has}; leave some out")).into());
    }
    Ok(beta)
}

/// The shape of somebody of another body mass index and the same height.
fn of_weight(beta: &[f32], bmi: f32, bundle: &Bundle) -> Result<Vec<f32>> {
    let other = BodyBuild::fit(&bundle.body).at_bmi(beta, bmi).map_err(|e| UsageError(format!("--bmi {bmi}: {e}")))?;
    if other.iter().any(|b| b.abs() > LARGEST_COEFFICIENT) {
        let message = format!("--bmi {bmi}: the body has no such shape at this height; ask for less change");
        return Err(UsageError(message).into());
    }
    Ok(other)
}
