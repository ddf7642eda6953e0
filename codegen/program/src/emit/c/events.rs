//! The events of a scene: their names, directions and effects.
//!
//! Deliberately does not know: what the functions compute, how events are located.

use std::fmt::Write as _;

use super::text::{elements, length};
use super::writer::Writer;
use hamel_expr::error::Error;

impl Writer<'_> {
    /// What events are, and what they do.
    ///
    /// # Errors
    /// [`Error::UnknownName`] where what an event sets is no output.
    pub(super) fn events(&mut self) -> Result<(), Error> {
        let (module, events) = (self.module, &self.module.text.events);
        let Some(values) = module.event_functions() else {
            self.constant("Number of events.", "N_EVENTS", 0);
            return Ok(());
        };
        self.constant("Number of events.", "N_EVENTS", events.len());
        let names: Vec<String> = events.iter().map(|event| event.name.clone()).collect();
        let doc = format!(
            "Names of the events; {} computes the functions whose zeros they are.",
            self.name(values)
        );
        self.array_of_names(&doc, "event_names", &names);
        let directions: Vec<String> = events
            .iter()
            .map(|event| match event.directions {
                (true, false) => "1".to_owned(),
                (false, true) => "-1".to_owned(),
                _ => "0".to_owned(),
            })
            .collect();
        self.array(
            "1 where an event is told as its function rises through zero, -1 as it falls, 0 both.",
            &format!("int {}[{}]", self.name("event_directions"), length(events.len())),
            &elements(&directions),
        );
        let (mut cases, mut sets) = (String::new(), false);
        for (k, event) in events.iter().enumerate() {
            let action = i32::from(event.sets.is_some()) + 2 * i32::from(event.stops);
            let Some((output, places)) = &event.sets else {
                if event.stops {
                    let _ = write!(cases, "    case {k}:\n        return {action};\n");
                }
                continue;
            };
            sets = true;
            let found = module.outputs.iter().find(|o| o.text.name == *output);
            let output = found.ok_or_else(|| Error::UnknownName {
                name: output.clone(),
                kind: "output with what an event sets",
                known: module.outputs.iter().map(|o| o.text.name.clone()).collect(),
            })?;
            let function = self.name(&output.name);
            let _ = write!(cases, "    case {k}: {{\n        double values[{}];\n", length(places.len()));
            match output.is_scalar() {
                true => _ = writeln!(cases, "        values[0] = {function}(p, t, y);"),
                false => _ = writeln!(cases, "        {function}(p, t, y, values);"),
            }
            for (at, place) in places.iter().enumerate() {
                let _ = writeln!(cases, "        y[{place}] = values[{at}];");
            }
            let _ = write!(cases, "        return {action};\n    }}\n");
        }
        let unread = if sets { "" } else { "    (void)p;\n    (void)t;\n    (void)y;\n" };
        let body = format!("{unread}    switch (event) {{\n{cases}    default:\n        return 0;\n    }}\n");
        let doc = [
            "Carries out an event at a point, by its number.".to_owned(),
            String::new(),
            "Returns 0 where nothing happens, 1 where the state was changed, 2 where the motion ends, 3 for both."
                .to_owned(),
        ];
        let (name, prepared, n) =
            (self.name("event_apply"), self.name("prepared"), length(module.state.len()));
        let signature =
            |name: &str| format!("int {name}(const {prepared} *p, int event, double t, double y[{n}])");
        if events.iter().all(|event| !event.is_condition) {
            self.function(&doc, &signature(&name), &body);
            return Ok(());
        }
        let effect = self.name("event_effect");
        let of_one = ["Carries out one event, and none that follow.".to_owned()];
        self.function(&of_one, &signature(&effect), &body);
        let conditions: Vec<String> =
            events.iter().map(|event| i32::from(event.is_condition).to_string()).collect();
        let body = format!(
            "    static const int is_condition[{k}] = {{{conditions}}};\n    \
             int done[{k}] = {{0}}, action = 0;\n    \
             double before[{k}], after[{k}];\n    \
             while (event >= 0 && event < {k}) {{\n        \
             done[event] = 1;\n        \
             {values}(p, t, y, before);\n        \
             action |= {effect}(p, event, t, y);\n        \
             {values}(p, t, y, after);\n        \
             event = 0;\n        \
             while (event < {k} && !(is_condition[event] && !done[event] && before[event] >= 0.0 && after[event] < 0.0)) {{\n            \
             event++;\n        \
             }}\n    \
             }}\n    \
             return action;\n",
            k = events.len(),
            conditions = conditions.join(", "),
            values = self.name(values),
        );
        let follows = "Conditions that it has made true follow, each once.".to_owned();
        let doc = [doc[0].clone(), follows, doc[1].clone(), doc[2].clone()];
        self.function(&doc, &signature(&name), &body);
        Ok(())
    }
}
