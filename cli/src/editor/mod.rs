//! Model files in editors: problems while somebody writes, what names stand for, what may be written next.
//!
//! `server` speaks the Language Server Protocol, whose messages `wire` reads and writes; the others answer one kind of
//! question each, about one text. All they know of the language is from [`hamel_codegen::spec`], so that an editor and
//! the commands say the same.
//!
//! Does not know: files, scenes, generated code.

mod actions;
mod completion;
mod document;
mod hover;
mod navigation;
mod position;
mod server;
mod structure;
mod wire;
mod work;

pub use server::serve;

#[cfg(test)]
mod tests;
