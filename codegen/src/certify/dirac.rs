//! The matrices of a Dirac structure beside constraints, momenta and bracket of the model.
//!
//! The structure pairs to zero with itself, its rows are independent, and an element that is made of the model's own
//! one-forms and bracket is in it, at each point another one. Does not know: how the matrices were derived.
//!
//! # Source
//! Gay-Balmaz, Yoshimura 2015, equations (2.11), (5.4).

use hamel_runtime::{Dual, Real};

use hamel_mechanics::mechanics::{Output, OutputKind};

use super::definition::Missing;
use super::linear::Reduced;
use super::motion::constants;
use super::random::Random;
use super::results::{Open, Outcome, Results};
use super::sheet::Sheet;
use super::wide::Wide;

fn products<'a>(a: &'a [Wide], b: &'a [Wide]) -> impl Iterator<Item = Wide> + 'a {
    a.iter().zip(b).map(|(a, b)| *a * *b)
}

impl Results<'_, '_> {
    pub(super) fn dirac(
        &self,
        output: &Output,
        found: &[Wide],
        sheet: &mut Sheet,
        random: &mut Random,
    ) -> Outcome {
        if output.kind == OutputKind::Component {
            return Err(Open::Because(
                "a Dirac structure is held as a whole, and the scene has one component",
            ));
        }
        let n = self.setting.definition.m;
        if found.len() != 8 * n * n {
            return Err(Open::Because("the frame has velocities that the model does not have"));
        }
        let function = output.name.as_str();
        let (flows, efforts) = found.split_at(4 * n * n);
        let (flows, efforts): (Vec<&[Wide]>, Vec<&[Wide]>) =
            (flows.chunks(2 * n).collect(), efforts.chunks(2 * n).collect());
        for (j, (f, e)) in flows.iter().zip(&efforts).enumerate() {
            for (g, d) in flows[..=j].iter().zip(&efforts) {
                let terms: Vec<Wide> = products(e, g).chain(products(f, d)).collect();
                sheet.zero(function, "rows pair to zero", &terms);
            }
        }
        let rows = flows.iter().zip(&efforts).map(|(f, e)| [f, *e, &[Wide::ZERO]].concat()).collect();
        let missing = 2 * n - Reduced::new(rows, 4 * n).rank();
        sheet.vanishes(function, "rows are independent", Wide::from_f64(missing as f64), 1.0);
        let (flow, effort) = self.element_of_dirac(random)?;
        for (f, e) in flows.iter().zip(&efforts) {
            let terms: Vec<Wide> = products(f, &flow).chain(products(e, &effort)).collect();
            sheet.zero(function, "an element of the structure", &terms);
        }
        Ok(())
    }

    /// Flows and efforts: a displacement `eta`, any `gamma`, `w = eta` and
    /// `pdot_k = -gamma_k - p.[e_k, eta] + lambda_A a^A_k`.
    fn element_of_dirac(&self, random: &mut Random) -> Result<(Vec<Wide>, Vec<Wide>), Missing> {
        let definition = &self.setting.definition;
        let (at, n) = (&self.motion.at, definition.m);
        let unit =
            |k: usize| -> Vec<Wide> { (0..n).map(|j| if j == k { Wide::ONE } else { Wide::ZERO }).collect() };
        // Along the frame, then along velocities that only parametrise constraints.
        let forms: Vec<Vec<Wide>> = definition.one_forms(at)?.into_iter().map(|(_, form)| form).collect();
        let n_all = definition.n_displacements();
        let with_zero = forms.iter().map(|form| [form.as_slice(), &[Wide::ZERO]].concat()).collect();
        let eta = Reduced::new(with_zero, n_all).solution(&random.vector(n_all))[..n].to_vec();
        let in_group = definition.group_velocities(&at.env, &eta)?;
        // Sections with constant coefficients in the frame of the system, along each other.
        let rate = |section: &[Wide], along: &[Wide]| -> Result<Vec<Wide>, Missing> {
            let moved = self.setting.seeded(&at.env, &definition.anchored(&at.env, along)?);
            let moved: Vec<Dual<Wide>> = definition.group_velocities(&moved, &constants(section))?;
            Ok(moved.into_iter().map(|x| x.derivative).collect())
        };
        let still = definition.model_velocities(&at.env, &vec![Wide::ZERO; n])?;
        let gamma = random.vector(n);
        let turned =
            (n..n_all).map(|k| forms.iter().map(|form| form[k]).chain([Wide::ZERO]).collect()).collect();
        let lambda = Reduced::new(turned, forms.len()).solution(&random.vector(forms.len()));
        let mut rates = Vec::new();
        for k in 0..n {
            let section = definition.group_velocities(&at.env, &unit(k))?;
            let mut bracket = definition.bracket(&at.env, &section, &in_group)?;
            let (forward, backward) = (rate(&eta, &section)?, rate(&unit(k), &in_group)?);
            for ((z, forward), backward) in bracket.iter_mut().zip(forward).zip(backward) {
                *z += forward - backward;
            }
            let own = definition.model_velocities(&at.env, &bracket)?;
            let own: Vec<Wide> = own.iter().zip(&still).map(|(y, still)| *y - *still).collect();
            let reaction = forms.iter().zip(&lambda).fold(Wide::ZERO, |sum, (form, l)| sum + form[k] * *l);
            rates.push(reaction - gamma[k] - definition.momentum_along(at, &own)?);
        }
        Ok(([eta.as_slice(), &rates].concat(), [gamma, eta].concat()))
    }
}
