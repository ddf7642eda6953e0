//! Which parameters and components of a scene's state form vectors, matrices, attitudes and places.
//!
//! Does not know: how a module speaks of them.

use hamel_expr::SymbolId;
use hamel_lang::spec::Layout;
use hamel_mechanics::reduction::{Block, BlockKind};
use hamel_program::emit::{GroupKind, GroupText, GroupTexts};

use super::built::BuiltScene;

/// All groups of which the scene has every number: what it fixes or leaves out takes the group with it.
pub fn groups(scene: &BuiltScene) -> GroupTexts {
    let system = &scene.equations.system;
    let params: Vec<SymbolId> = system.params.iter().map(|p| p.symbol).collect();
    let arrays = system.param_arrays.iter().filter_map(|array| {
        let kind = match array.layout {
            Layout::Vector(_) => GroupKind::Vector,
            Layout::Diagonal(_) => GroupKind::Diagonal,
            Layout::Symmetric(n) => GroupKind::Symmetric(n),
            Layout::Matrix(n_rows, n_columns) => GroupKind::Matrix(n_rows, n_columns),
        };
        group(&array.name, kind, &array.symbols, &params)
    });
    let state: Vec<SymbolId> = scene.state.iter().map(|s| s.symbol).collect();
    GroupTexts { params: arrays.collect(), state: of_state(&system.blocks, &state) }
}

/// The groups of a state: its vectors and attitudes, then the places that these make.
fn of_state(blocks: &[Block], state: &[SymbolId]) -> Vec<GroupText> {
    let mut groups = Vec::new();
    let mut places = Vec::new();
    for (k, block) in blocks.iter().enumerate() {
        let (kind, place) = match block.kind {
            BlockKind::Attitude => (GroupKind::Attitude, Some(GroupKind::Place)),
            BlockKind::Heading => (GroupKind::Vector, Some(GroupKind::PlanarPlace)),
            BlockKind::Matrix(n) => (GroupKind::Matrix(n, n), None),
            BlockKind::Velocity
            | BlockKind::Momentum
            | BlockKind::Advected
            | BlockKind::FirstOrder
            | BlockKind::Position { .. }
            | BlockKind::Reconstructed => (GroupKind::Vector, None),
        };
        // One number is a field and no vector.
        if block.components.len() > 1 {
            groups.extend(group(&block.name, kind, &block.components, state));
        }
        let own = |other: &&Block| other.kind == BlockKind::Position { attitude: k };
        let position: Vec<SymbolId> =
            blocks.iter().filter(own).flat_map(|other| other.components.iter().copied()).collect();
        if let Some(place) = place.filter(|_| !position.is_empty()) {
            let components = [block.components.as_slice(), &position].concat();
            places.extend(group("place", place, &components, state));
        }
    }
    groups.extend(places);
    groups
}

/// The group of some numbers among all; none unless all of them are there.
fn group(name: &str, kind: GroupKind, symbols: &[SymbolId], among: &[SymbolId]) -> Option<GroupText> {
    let components: Option<Vec<usize>> =
        symbols.iter().map(|symbol| among.iter().position(|s| s == symbol)).collect();
    Some(GroupText { name: name.to_owned(), kind, components: components? })
}
