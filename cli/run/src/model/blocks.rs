//! State variables that belong together in a figure.
//!
//! Does not know: figures, scenes.

use hamel_codegen::spec::{Domain, FluidField, MatrixFluid, ReconstructionKind};

use super::Model;
use super::spelling::{lower_first, spell};
use super::units::split_unit;

/// State variables that belong together in a figure.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Block {
    /// Symbol of the vector, or nothing for a group of scalars.
    pub symbol: String,
    /// What they are, without the unit.
    pub doc: String,
    /// Their unit; empty when it is unknown or one.
    pub unit: String,
    /// Names of the members, and how they are spelled for people.
    pub members: Vec<(String, String)>,
}

/// The modes of a fluid of matrices that the model names, in a block for vorticity and for each carried field.
pub fn of_matrices(fluid: &MatrixFluid) -> Vec<Block> {
    let carried = fluid.carried.iter().enumerate().map(|(k, field)| (FluidField::Carried(k), &field.doc));
    let fields = std::iter::once((FluidField::Vorticity, &fluid.vorticity)).chain(carried);
    let blocks = fields.map(|(field, doc)| {
        let (doc, unit) = split_unit(doc, 0);
        let of_field = fluid.modes.iter().filter(|mode| mode.field == field);
        let members = of_field.map(|mode| (mode.name.clone(), spell(&mode.name))).collect();
        Block { symbol: String::new(), doc, unit, members }
    });
    blocks.filter(|block| !block.members.is_empty()).collect()
}

/// Groups the possible state variables of a model: coordinates and their velocities by unit, vectors as they are.
pub fn blocks(model: &Model) -> Vec<Block> {
    let mut blocks: Vec<Block> = Vec::new();
    let mut scalars: Vec<Block> = Vec::new();
    let mut rates: Vec<Block> = Vec::new();
    let add = |list: &mut Vec<Block>, unit: String, doc: &str, name: &str| {
        let member = (name.to_owned(), spell(name));
        match list.iter_mut().find(|b| b.unit == unit) {
            Some(block) => {
                block.members.push(member);
                block.doc = if block.doc == doc { doc.to_owned() } else { String::new() };
            }
            None => {
                list.push(Block { symbol: String::new(), doc: doc.to_owned(), unit, members: vec![member] })
            }
        }
    };
    for (k, coordinate) in model.base.iter().enumerate() {
        let (doc, unit) = split_unit(&coordinate.doc, 0);
        let unit = match (unit.is_empty(), coordinate.domain) {
            (true, Domain::Angle) => "rad".to_owned(),
            _ => unit,
        };
        add(&mut scalars, unit.clone(), &doc, &coordinate.name);
        if k >= model.n_shape() {
            continue;
        }
        if let Some(own) = model.frame.as_ref().and_then(|frame| frame.docs[k].as_ref()) {
            let (doc, unit) = split_unit(own, 0);
            add(&mut rates, unit, &doc, &coordinate.velocity_name);
            continue;
        }
        let rate = match unit.as_str() {
            "" => String::new(),
            unit => format!("{unit}/s"),
        };
        let doc = if doc.is_empty() { String::new() } else { format!("Rate of {}", lower_first(&doc)) };
        add(&mut rates, rate, &doc, &coordinate.velocity_name);
    }
    for (list, several) in [(scalars, "Coordinates"), (rates, "Velocities of the coordinates")] {
        for mut block in list {
            if block.members.len() > 1 && block.doc.is_empty() {
                block.doc = several.to_owned();
            }
            blocks.push(block);
        }
    }
    let mut seen: Vec<(&str, &str)> = Vec::new();
    for velocity in model.velocities.iter().chain(&model.quasi_velocities) {
        let member = (velocity.name.clone(), spell(&velocity.name));
        if seen.contains(&(velocity.block.as_str(), velocity.doc.as_str()))
            && let Some(block) = blocks.last_mut()
        {
            block.members.push(member);
            continue;
        }
        // One line of documentation may describe several blocks, each with its own unit.
        let position = seen.iter().filter(|(_, doc)| *doc == velocity.doc).count();
        seen.push((&velocity.block, &velocity.doc));
        let (doc, unit) = split_unit(&velocity.doc, position);
        blocks.push(Block { symbol: spell(&velocity.block), doc, unit, members: vec![member] });
    }
    for advected in &model.advected {
        let (doc, unit) = split_unit(&advected.doc, 0);
        let members = advected.components.iter().map(|(name, _)| (name.clone(), spell(name)));
        blocks.push(Block { symbol: spell(&advected.name), doc, unit, members: members.collect() });
    }
    for state in &model.first_order {
        let (doc, unit) = split_unit(&state.doc, 0);
        let members = state.components.iter().map(|(name, _)| (name.clone(), spell(name)));
        blocks.push(Block { symbol: spell(&state.name), doc, unit, members: members.collect() });
    }
    for item in &model.reconstruction {
        // A pose is two things of different units.
        let n_turn = match item.kind {
            ReconstructionKind::PlanarPose { .. } => 1,
            ReconstructionKind::Pose { .. } => 4,
            _ => 0,
        };
        let (turn, rest) = item.names.split_at(n_turn);
        let is_described_apart = item.doc.matches('[').count() > 1;
        for (names, what) in [(turn, "Attitude"), (rest, "Position")] {
            if names.is_empty() {
                continue;
            }
            let position = usize::from(n_turn > 0 && what == "Position" && is_described_apart);
            let (mut doc, mut unit) = split_unit(&item.doc, position);
            if n_turn > 0 && !is_described_apart {
                doc = what.to_owned();
                if what == "Attitude" {
                    unit = if n_turn == 1 { "rad".to_owned() } else { String::new() };
                }
            }
            if doc.is_empty() {
                doc = "Group".to_owned();
            }
            let members = names.iter().map(|name| (name.clone(), spell(name))).collect();
            blocks.push(Block { symbol: String::new(), doc, unit, members });
        }
    }
    blocks
}
