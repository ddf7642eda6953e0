//! The words of the language, each with its form and a sentence: for editors.
//!
//! The sentences of items are those of `docs/model-language.md`, word for word. Deliberately does not know: where a
//! word may stand, how an item is read.

use super::names::{FUNCTIONS, ITEMS, OPERATORS};

/// What a word of the language is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum WordKind {
    /// It begins an item.
    Item,
    /// It stands within an item.
    Part,
    /// A function.
    Function,
    /// `pi` or `t`.
    Constant,
    /// An algebra, a group, a representation, a domain, a shape or the like.
    Setting,
}

/// A word of the language.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Word {
    /// The word.
    pub word: &'static str,
    /// What it is.
    pub kind: WordKind,
    /// How it is written; empty where it stands alone. Two forms of an item are parted by `` ` or ` ``.
    pub form: &'static str,
    /// What it means.
    pub sentence: &'static str,
}

/// Sentences of items, from their sections of the reference.
const OF_ITEMS: &[(&str, &str)] = &[
    ("source", "Where the model comes from; any number of them."),
    ("topic", "What `hamel list` shows the model under."),
    (
        "size",
        "A file with sizes is a family of models, and the model is its member for the values that the file \
         gives them.",
    ),
    (
        "for",
        "`for` repeats items, with an index that runs through a range; both ends belong to it, and a range \
         that ends before it begins has nothing.",
    ),
    (
        "param",
        "A parameter with its default: a constant expression without names, for vectors and matrices a \
         list in the order of the components.",
    ),
    (
        "input",
        "An input moves the system from outside; the expression behind it is the value that it is held at, \
         written as the default of a parameter.",
    ),
    (
        "noise",
        "White noise moves the system along the Hamiltonian vector field of a function of the state, in the sense of \
         Stratonovich.",
    ),
    (
        "drive",
        "`drive` gives an input, a vector or a component, a value in every scene: a function of time, \
         coordinates, velocities, advected parameters and parameters.",
    ),
    ("require", "Validity conditions that belong to no single parameter."),
    ("let", "A name for an expression, substituted where it is used."),
    ("algebra", "A name for an algebra, or an algebra by its brackets `[e_a, e_b] = C^c_ab e_c`."),
    ("almost", "`almost algebra` leaves out the Jacobi identity:"),
    (
        "algebroid",
        "A Lie algebroid over the base coordinates, in the place of base velocities and an algebra: a \
         basis of sections, the velocities along them, the rates of the coordinates by these (the anchor; \
         zero where it is not given), and brackets with coefficients on the base.",
    ),
    (
        "representation",
        "A representation by one matrix per basis element, `rho([a, b]) = rho(a) rho(b) - rho(b) rho(a)`, \
         checked exactly.",
    ),
    ("velocity", "The velocity `xi` in the algebra: one name per block or one per basis element."),
    (
        "momentum",
        "`momentum` names the momenta along a velocity: `W^T dL/dy`, with the virtual displacements `W` \
         that change this velocity alone among the independent ones; without constraints `dL/dy`.",
    ),
    (
        "carry",
        "`carry` makes them state variables in the place of their velocities, slot by slot, in all scenes \
         of the model or in one (`carry Omega;` in a scene goes back to the velocity).",
    ),
    (
        "routh",
        "`routh Omega -> Pi;` says both at once: `Pi` is the momentum of `Omega`, and the state carries \
         it.",
    ),
    (
        "quasi_velocity",
        "A velocity that is neither a base velocity nor a component of `xi` and only parametrises the \
         constraints: with it a constraint can be written in a form that stays solvable where the \
         equations between the other velocities degenerate.",
    ),
    (
        "frame",
        "Quasi-velocities in the place of velocities, each linear in them, with coefficients made of base \
         coordinates, time and parameters; with a name, `frame tool at p attitude R;`, a frame on a body.",
    ),
    (
        "connection",
        "The component of a principal connection along a velocity of the algebra, vector or component: \
         that velocity is `v = xi + A(x, t) xdot`, and the item gives `A(x, t) xdot`, linear in the base \
         velocities with coefficients made of base coordinates, time and parameters.",
    ),
    (
        "action",
        "`left` (the default): `xi = g^-1 gdot`, the body frame. `right`: `xi = gdot g^-1`, the space \
         frame.",
    ),
    ("stage", "A chain of ideals `g = n_0 > n_1 > ..`, each an ideal of the one before."),
    (
        "inner_product",
        "Level `j` of the reduction is the orthogonal complement of `n_{j+1}` in `n_j` for the inner \
         product:",
    ),
    ("coordinate", "Base (shape) coordinates that the group does not move, with their velocity `name_dot`."),
    (
        "advected",
        "A parameter that the group moves, `a = g^-1 a_0`, given by the infinitesimal action `xi . a`, an \
         expression linear in the velocities: `adot = -xi . a` for a left action, `adot = xi . a` for a \
         right one.",
    ),
    (
        "configuration",
        "Coordinates in a group of matrices that everything may contain: the entries of the matrix, \
         `R11, R12, ..`, and vectors of a semidirect product.",
    ),
    (
        "state",
        "A state of first order: a number or a vector of the state whose rate the model gives, a function of \
         the state, inputs and the time.",
    ),
    ("lagrangian", "The reduced Lagrangian `l(x, xdot, xi, a, t)`: a number. Exactly one."),
    (
        "hamiltonian",
        "A function `h(x, p, t)` of base coordinates, momenta, advected parameters and time, in the place \
         of a Lagrangian:",
    ),
    (
        "acceleration",
        "`acceleration v = ..;` is the rate of a velocity, vector or component, a function of the state \
         and time;",
    ),
    (
        "field",
        "`field v = ..;` is the velocity itself, a function of base coordinates, advected parameters and \
         time, so that the state does not have it.",
    ),
    (
        "constraint",
        "An equation between velocities; its coefficients may depend on coordinates, advected parameters \
         and time.",
    ),
    (
        "virtual",
        "A condition on virtual displacements, linear in the displacements `delta(v)` of velocities `v`, \
         vectors or components;",
    ),
    (
        "independent",
        "`independent` chooses the velocities and quasi-velocities that stay in the state; the generator \
         chooses when it is absent.",
    ),
    (
        "multipliers",
        "`multipliers` keeps all velocities and solves for the multipliers, which is also what happens \
         when no constant choice of independent velocities exists.",
    ),
    (
        "actuate",
        "`actuate u along x_dot;` is a force with the power `u*x_dot`, along any combination of velocities.",
    ),
    (
        "lyapunov",
        "`lyapunov V = .. rate ..;` says what `u` is: the force that gives the function `V` of coordinates, \
         velocities, advected parameters, time and parameters this rate along the motion, or conserves it \
         where no rate is given.",
    ),
    ("force", "An external force `F_a` paired with a velocity, vector or component: its power is `F . xi`."),
    ("moment", "`moment on B: M;` is `force along B_spin: M;`, a moment in the body's frame."),
    (
        "body",
        "A rigid body, or a point: mass and place of its mass centre, inertia and attitude of its frame, or \
         one of both.",
    ),
    (
        "use",
        "The model has the model of another file as a part, each name behind that of the part, and its Lagrangian \
         is added.",
    ),
    (
        "reduces",
        "The model is the quotient of the model of another file, by functions of that one for variables and \
         parameters of this one.",
    ),
    ("casimir", "`casimir` names a number that the motion conserves, whatever its initial state:"),
    ("output", "`output` names any value, vectors with components `h1, h2, ..`."),
    (
        "section",
        "A section `s` of the velocities, along which the momentum `<p, s> = s^a dL/dy^a` is wanted:",
    ),
    ("mode", "A mode has constraints, forces and events that are there while it is on."),
    ("event", "An event is a change of sign of a function of the state, time and parameters:"),
    (
        "reconstruct",
        "Coordinates of the group, or others that the equations of motion do not contain; they are \
         computed in scenes that want `reconstruction`.",
    ),
    (
        "initial",
        "The default initial value of a state variable or a reconstructed coordinate, vector or \
         component, made of numbers and parameters.",
    ),
    (
        "view",
        "What a figure in space shows, such as that of `hamel report`; equations and generated code do \
         not depend on it.",
    ),
    ("want", "`want digits;` beside the scenes is a want of all scenes of the model, also without a block."),
    (
        "scene",
        "The model with some parameters fixed to numbers, which are folded into the code, and some \
         outputs wanted:",
    ),
];

/// Functions: how they are called, as the reference writes it, and what they are.
const OF_FUNCTIONS: &[(&str, &str, &str)] = &[
    ("dot", "dot(a, b)", "pairing of two vectors"),
    ("cross", "cross(a, b)", "product in R^3"),
    ("norm", "norm(a)", "Euclidean norm"),
    ("unit", "unit(a)", "direction, of length one"),
    ("rate", "rate(x)", "derivative by time of what is made of coordinates, time and parameters"),
    ("spin", "spin(R)", "angular velocity of the frame with an attitude, in that frame"),
    (
        "rot",
        "rot(axis, phi)",
        "rotation by an angle; `rot(phi)` is that of the plane, `rot(v)` that of a rotation vector",
    ),
    (
        "log",
        "log(R)",
        "rotation vector of a rotation, angle of one of the plane; `log(R, r)` is the twist of a displacement",
    ),
    ("orthonormal", "orthonormal(A)", "the rotation nearest to a matrix of rounded numbers"),
    ("sinc", "sinc(x)", "`sin(x)/x`, one at zero"),
    ("cosc", "cosc(x)", "`(1 - cos(x))/x^2`, one half at zero"),
    ("sum", "sum(a)", "sum of the entries"),
    ("transpose", "transpose(A)", "of a vector: one row"),
    ("diag", "diag(v)", "diagonal matrix of a vector, diagonal of a matrix"),
    ("identity", "identity(n)", "unit matrix"),
    ("hat", "hat(v)", "`hat(v) w = v x w`"),
    ("det", "det(A)", "determinant, up to 8 rows"),
    ("trace", "trace(A)", "trace, up to 8 rows"),
    ("sqrt", "sqrt(x)", "square root"),
    ("pow", "pow(x, y)", "rational `y` is exact, otherwise `exp(y ln x)`"),
    ("atan2", "atan2(y, x)", "angle of the point (x, y) in (-pi, pi]"),
    ("ad", "ad([g,] x, y)", "bracket of the algebra `g`, or of that of the velocities"),
    ("coad", "coad([g,] x, mu)", "coadjoint action of the algebra `g`, or of that of the velocities"),
    (
        "laplacian",
        "laplacian([g])",
        "for algebras of functions: the diagonal matrix of `-|m|^2`, on the sphere of `-l (l + 1)`",
    ),
    ("poisson", "poisson([g,] f, h)", "bracket of two functions by the coefficients of their modes"),
    ("pointwise", "pointwise([g,] f, h)", "product of two functions on the circle by their coefficients"),
    ("star_power", "star_power([g,] f, k)", "coefficients of the `k`-th power of the matrix of `f`"),
    ("trace_power", "trace_power([g,] f, k)", "trace of the `k`-th power of the matrix of `f`, by `N`"),
    ("delta", "delta(v)", "virtual displacement of a velocity, in `virtual`"),
    ("ddt", "ddt(v)", "acceleration of a velocity, in `constraint` and `virtual`"),
];

/// Words within items.
const PARTS: &[(&str, &str, &str)] = &[
    ("model", "model name { .. }", "A file holds one model."),
    ("part", "part motor \"motor.hamel\" { .. }", "A model that this one uses, as it was put into the text."),
    ("in", "", "The algebra, the space, the group or the domain follows."),
    ("of", "", "The velocity or the algebra follows."),
    ("on", "", "The space of a representation follows."),
    ("by", "", "The infinitesimal action or the rate follows."),
    ("as", "as a_*", "What precedes the names of basis elements in those of components."),
    ("from", "", "The velocities that move the group follow."),
    ("relative", "relative Omega", "The velocities that move the frame of a configuration follow."),
    ("where", "where m > 0", "Conditions on the parameter, checked where parameters are given."),
    ("up", "routh u = p up to x;", "The function follows up to whose rate the Lagrangian is invariant."),
    ("to", "routh u = p up to x;", "The function follows up to whose rate the Lagrangian is invariant."),
    ("thermo", "virtual thermo;", "Displacements of constraints that are balances of powers."),
    ("along", "force along u: F;", "The velocity that the force or the actuator is paired with follows."),
    ("mass", "mass m;", "The mass of the body."),
    ("place", "place p;", "Where the mass centre of the body is."),
    ("inertia", "inertia I;", "The inertia about the mass centre, in the body's frame."),
    ("around", "", "The centre of the shape in its own frame."),
    ("at", "", "Where the frame of the shape stands."),
    ("attitude", "", "How the frame of the shape is turned."),
    ("rising", "", "From negative to zero or positive."),
    ("falling", "", "From positive to zero or negative."),
    ("then", "then v = -e*v;", "The value after the event; the right side is taken at the state before."),
    ("when", "event lift when lambda_foot < 0", "A comparison: the event happens where it begins to hold."),
    ("enter", "enter stance;", "The constraints of the mode begin to hold, by an impact."),
    ("leave", "leave stance;", "The constraints of the mode hold no longer."),
    ("impact", "impact stance with e;", "The constraints of the mode are struck and do not hold."),
    ("with", "impact stance with e;", "The part of the velocity that comes back follows."),
    ("stop", "stop;", "Ends the motion."),
    ("basis", "basis a, b;", "Names of the basis elements."),
    ("velocities", "velocities u, v;", "Names of the velocities along the basis."),
    ("anchor", "anchor x_dot = u;", "The rate of a coordinate by the velocities."),
    ("fix", "fix m = 1;", "Parameters that are numbers in this scene."),
    (
        "want",
        "want energy;",
        "Functions and outputs that the scene has, `digits` also for all scenes of a model.",
    ),
    ("drop", "drop x;", "Coordinates and advected parameters that the scene leaves out."),
    ("circle", "circle q;", "Angles that are carried as points of the circle."),
    ("formulation", "formulation auto;", "Searches for a formulation that costs less."),
    ("discrete", "discrete midpoint;", "Discrete equations of motion, by a quadrature of the action."),
    ("retraction", "retraction cayley;", "The map from the algebra to the group in discrete equations."),
];

/// Algebras, groups, representations, domains, shapes and the like.
const SETTINGS: &[&str] = &[
    "R",
    "so",
    "se",
    "su",
    "u",
    "gl",
    "sl",
    "sp",
    "sim",
    "galilei",
    "heisenberg",
    "zeitlin",
    "zeitlin_sphere",
    "torus",
    "witt",
    "product",
    "semidirect",
    "vorticity",
    "standard",
    "adjoint",
    "coadjoint",
    "functions",
    "densities",
    "dual",
    "trivial",
    "SO",
    "SE",
    "SU",
    "U",
    "GL",
    "SL",
    "Sp",
    "matrices",
    "angle",
    "real",
    "scalar",
    "vector",
    "diagonal",
    "symmetric",
    "matrix",
    "left",
    "right",
    "mechanical",
    "nonholonomic",
    "ideal",
    "auto",
    "midpoint",
    "cayley",
    "box",
    "disk",
    "ball",
    "segment",
    "point",
    "path",
];

/// All words of the language.
pub fn vocabulary() -> Vec<Word> {
    let sentence = |word: &str| OF_ITEMS.iter().find(|(item, _)| *item == word).map_or("", |(_, text)| *text);
    let items = ITEMS.iter();
    let items = items.map(|(word, form)| Word { word, kind: WordKind::Item, form, sentence: sentence(word) });
    let part = |(word, form, sentence): &(&'static str, &'static str, &'static str)| Word {
        word,
        kind: WordKind::Part,
        form,
        sentence,
    };
    let function = |word: &'static str| {
        let known = OF_FUNCTIONS.iter().find(|(name, ..)| *name == word);
        let (form, sentence) = known.map_or(("", "function of a number"), |(_, form, text)| (*form, *text));
        Word { word, kind: WordKind::Function, form, sentence }
    };
    let functions = FUNCTIONS.iter().copied().chain(OPERATORS.iter().map(|(name, _)| *name)).map(function);
    let constants = [("pi", "the number"), ("t", "the time")].map(|(word, sentence)| Word {
        word,
        kind: WordKind::Constant,
        form: "",
        sentence,
    });
    let settings = SETTINGS.iter().map(|word| Word { word, kind: WordKind::Setting, form: "", sentence: "" });
    items.chain(PARTS.iter().map(part)).chain(functions).chain(constants).chain(settings).collect()
}

/// What kind of word of the language a word is, where parentheses follow or not; nothing for others.
pub(super) fn kind_of(word: &str, is_called: bool) -> Option<WordKind> {
    let is_function = FUNCTIONS.contains(&word) || OPERATORS.iter().any(|(name, _)| *name == word);
    if is_called && is_function {
        return Some(WordKind::Function);
    }
    if ITEMS.iter().any(|(item, _)| *item == word) {
        return Some(WordKind::Item);
    }
    if PARTS.iter().any(|(part, ..)| *part == word) {
        return Some(WordKind::Part);
    }
    if matches!(word, "pi" | "t") {
        return Some(WordKind::Constant);
    }
    SETTINGS.contains(&word).then_some(WordKind::Setting)
}

/// Whether a word may join what stands before and behind it.
pub(super) fn is_connective(word: &str) -> bool {
    const WORDS: [&str; 15] = [
        "for", "in", "of", "on", "by", "as", "from", "where", "around", "at", "attitude", "rising",
        "falling", "then", "stop",
    ];
    WORDS.contains(&word)
}

#[cfg(test)]
mod tests {
    use super::{ITEMS, OF_FUNCTIONS, OF_ITEMS, WordKind, vocabulary};

    const DOC: &str = include_str!("../../../../docs/model-language.md");

    #[test]
    fn sentences_are_those_of_the_reference() {
        let doc = DOC.split_whitespace().collect::<Vec<_>>().join(" ");
        for (item, sentence) in OF_ITEMS {
            assert!(doc.contains(sentence), "{item}: {sentence}");
        }
        for (function, form, _) in OF_FUNCTIONS {
            assert!(doc.contains(&format!("`{form}`")), "{function}: {form}");
        }
        for (item, _) in ITEMS {
            assert!(OF_ITEMS.iter().any(|(known, _)| known == item), "{item} has no sentence");
        }
    }

    /// Every word in quotes of the grammar is a word of the vocabulary.
    #[test]
    fn the_grammar_has_no_other_words() {
        let grammar = DOC.split("```ebnf").nth(1).and_then(|rest| rest.split("```").next()).unwrap();
        let known: Vec<&str> = vocabulary().iter().map(|word| word.word).collect();
        let words = grammar.split('"').skip(1).step_by(2);
        let words: Vec<&str> =
            words.filter(|w| w.chars().all(|c| c.is_ascii_alphabetic() || c == '_')).collect();
        assert!(words.len() > 100);
        for word in words.iter().filter(|word| !matches!(**word, "e" | "E" | "stages" | "state" | "*")) {
            assert!(known.contains(word), "`{word}` is not in the vocabulary");
        }
        assert!(vocabulary().iter().any(|w| w.word == "sin" && w.kind == WordKind::Function));
    }
}
