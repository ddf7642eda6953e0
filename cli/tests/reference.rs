//! The machine interface of the interpreter, and of scenes compiled in memory, against reference values: it carries
//! full precision.

use crate::common::{Compared, check_motions, check_points, models};

#[test]
fn values_are_those_of_the_reference() {
    let models = models();
    assert!(models.len() >= 20, "{models:?}");
    for model in models {
        for via in ["jit", "interpreter"] {
            assert!(check_points(&model, via) > 0, "{model}");
        }
    }
}

#[test]
fn motions_are_those_of_the_reference_with_the_group() {
    let mut n_with_group = 0;
    for model in models() {
        let Compared { motions, of_group, reconstructions } = check_motions(&model, "jit");
        assert!(motions > 0, "{model}");
        // A file has the group's coordinates under the model's names, or none: those of fluids.
        assert_eq!(reconstructions, of_group, "{model}");
        n_with_group += usize::from(of_group == motions);
    }
    assert!(n_with_group >= 20, "{n_with_group}");
}
