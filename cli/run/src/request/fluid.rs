//! Requests on fluids of matrices: modes that a request leaves out begin as the model says.
//!
//! Does not know: how a fluid is moved.

use std::collections::BTreeMap;

use hamel_codegen::spec::MatrixFluid;

use super::simulate::Completion;
use crate::error::Error;
use crate::forms::Forms;
use crate::info::Info;
use crate::matrices;
use crate::simulation::SimulateRequest;

/// A JSON request on a fluid of matrices, and whether its model gives modes that the request leaves out.
///
/// # Errors
/// Everything that is wrong with the request, and parameters that the model has no fluid for.
pub fn request(fluid: &MatrixFluid, text: &str, info: &Info) -> Result<(SimulateRequest, bool), Error> {
    let defaults = info.params.iter().map(|p| p.default).collect::<Vec<f64>>();
    let started = |params: &[f64]| -> Result<BTreeMap<String, f64>, Error> {
        let values = matrices::initial(&matrices::at(fluid, params)?);
        Ok(info.state.iter().cloned().zip(values).collect())
    };
    let known = started(&defaults)?;
    let mut is_completed = false;
    let mut choose = |set: &BTreeMap<String, f64>, given: &BTreeMap<String, f64>| {
        is_completed = true;
        let params = info.params.iter().map(|p| set.get(&p.name).copied().unwrap_or(p.default));
        let known = started(&params.collect::<Vec<f64>>())?;
        Ok(info
            .state
            .iter()
            .map(|name| given.get(name).or_else(|| known.get(name)).copied().unwrap_or(0.0))
            .collect())
    };
    let mut completion = Completion { known: &known, choose: &mut choose };
    let forms = Forms::own(info);
    let request = SimulateRequest::parse_in(text, info, &forms, 0, &|_| Vec::new(), Some(&mut completion))?;
    Ok((request, is_completed))
}
