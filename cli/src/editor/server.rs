//! The conversation with an editor, by the Language Server Protocol over standard input and output.
//!
//! Does not know: what is answered to a question about a text.

use std::collections::BTreeMap;
use std::str::FromStr as _;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use hamel_codegen::spec;
use lsp_server::{ErrorCode, Message, Notification, Request, RequestId, Response};
use lsp_types::{
    CodeActionKind, CodeActionOptions, CodeActionParams, CodeActionProviderCapability, CodeLensOptions,
    CodeLensParams, CompletionOptions, CompletionParams, DidChangeTextDocumentParams,
    DidCloseTextDocumentParams, DidOpenTextDocumentParams, DocumentFormattingParams, DocumentHighlightParams,
    DocumentSymbolParams, FoldingRangeParams, FoldingRangeProviderCapability, GotoDefinitionParams, Hover,
    HoverContents, HoverParams, HoverProviderCapability, MarkupContent, MarkupKind, OneOf,
    PrepareRenameResponse, PublishDiagnosticsParams, Range, ReferenceParams, RenameOptions, RenameParams,
    SemanticTokens, SemanticTokensFullOptions, SemanticTokensLegend, SemanticTokensOptions,
    SemanticTokensParams, SemanticTokensResult, ServerCapabilities, SignatureHelpOptions,
    SignatureHelpParams, TextDocumentPositionParams, TextDocumentSyncCapability, TextDocumentSyncKind,
    TextEdit, Uri, WorkDoneProgressOptions,
};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};

use super::document::{Checked, Document};
use super::hover::{self, Answer, Wish};
use super::position::Lines;
use super::work::{Board, Workers};
use super::{actions, completion, navigation, structure, wire};
use hamel_run::error::Error;

/// How long an answer about a name waits for its equations: as long as nobody notices. Later ones find them.
const PATIENCE: Duration = Duration::from_millis(150);
/// How often it is looked whether somebody waits for too long.
const TICK: Duration = Duration::from_millis(50);
/// Said in the place of equations.
const DERIVING: &str = "\n\n*The equations are being derived.*";

/// An answer that waits for equations.
struct Waiting {
    id: RequestId,
    file: String,
    text: Arc<str>,
    answer: Answer,
    range: Range,
    since: Instant,
}

type Send = Arc<dyn Fn(Message) + std::marker::Send + Sync>;

/// Everything that the conversation is about.
struct Server {
    documents: BTreeMap<String, Document>,
    board: Board,
    workers: Workers,
    waiting: Arc<Mutex<Vec<Waiting>>>,
    /// The text that an answer has waited for the equations of, with its file.
    deriving: Option<(String, Arc<str>)>,
    send: Send,
}

/// What the server can do; commands are for editors that say to have a panel for what these show.
fn capabilities(has_panel: bool) -> ServerCapabilities {
    let progress = WorkDoneProgressOptions::default();
    ServerCapabilities {
        text_document_sync: Some(TextDocumentSyncCapability::Kind(TextDocumentSyncKind::INCREMENTAL)),
        hover_provider: Some(HoverProviderCapability::Simple(true)),
        completion_provider: Some(CompletionOptions::default()),
        signature_help_provider: Some(SignatureHelpOptions {
            trigger_characters: Some(vec!["(".to_owned(), ",".to_owned()]),
            retrigger_characters: None,
            work_done_progress_options: progress,
        }),
        folding_range_provider: Some(FoldingRangeProviderCapability::Simple(true)),
        code_lens_provider: has_panel.then_some(CodeLensOptions { resolve_provider: Some(false) }),
        definition_provider: Some(OneOf::Left(true)),
        references_provider: Some(OneOf::Left(true)),
        document_highlight_provider: Some(OneOf::Left(true)),
        document_symbol_provider: Some(OneOf::Left(true)),
        document_formatting_provider: Some(OneOf::Left(true)),
        rename_provider: Some(OneOf::Right(RenameOptions {
            prepare_provider: Some(true),
            work_done_progress_options: progress,
        })),
        code_action_provider: Some(CodeActionProviderCapability::Options(CodeActionOptions {
            code_action_kinds: Some(vec![CodeActionKind::QUICKFIX]),
            ..CodeActionOptions::default()
        })),
        semantic_tokens_provider: Some(
            SemanticTokensOptions {
                legend: SemanticTokensLegend {
                    token_types: navigation::TOKEN_TYPES.to_vec(),
                    token_modifiers: Vec::new(),
                },
                full: Some(SemanticTokensFullOptions::Bool(true)),
                ..SemanticTokensOptions::default()
            }
            .into(),
        ),
        ..ServerCapabilities::default()
    }
}

/// Talks to an editor until it says that this is all.
///
/// # Errors
/// [`Error::Io`] when the editor does not speak the protocol, or ends without saying so.
pub fn serve() -> Result<(), Error> {
    let failed = |e: &dyn std::fmt::Display| Error::io("the editor", std::io::Error::other(e.to_string()));
    let (connection, broken) = wire::stdio();
    // Where no message can be read, that says more than the end of the conversation.
    let failed =
        |e: &dyn std::fmt::Display| broken.reason().map_or_else(|| failed(e), |reason| failed(&reason));
    let (id, asked) = connection.initialize_start().map_err(|e| failed(&e))?;
    let has_panel = asked["initializationOptions"]["panel"] == true;
    let info = json!({
        "capabilities": capabilities(has_panel),
        "serverInfo": { "name": "hamel", "version": env!("CARGO_PKG_VERSION") },
    });
    connection.initialize_finish(id, info).map_err(|e| failed(&e))?;
    let outgoing = connection.sender.clone();
    let send: Send = Arc::new(move |message| {
        // An editor that has gone hears nothing.
        let _ = outgoing.send(message);
    });
    let mut server = Server::new(send);
    let outcome = loop {
        let message = match server.is_waited_for() {
            true => match connection.receiver.recv_timeout(TICK) {
                Ok(message) => Some(message),
                Err(e) if e.is_timeout() => None,
                Err(e) => break Err(failed(&e)),
            },
            false => match connection.receiver.recv() {
                Ok(message) => Some(message),
                Err(e) => break Err(failed(&e)),
            },
        };
        server.answer_late();
        match message {
            Some(Message::Request(request)) => match connection.handle_shutdown(&request) {
                Ok(true) => break Ok(()),
                Ok(false) => server.request(request),
                Err(e) => break Err(failed(&e)),
            },
            Some(Message::Notification(notification)) => server.notification(notification),
            Some(Message::Response(_)) | None => {}
        }
    };
    // Nobody waits for the threads: workers may be in the middle of a derivation.
    drop((server, connection));
    outcome
}

impl Server {
    fn new(send: Send) -> Server {
        let board = Board::default();
        let waiting: Arc<Mutex<Vec<Waiting>>> = Arc::default();
        let publish = Arc::clone(&send);
        let on_checked = move |file: &str, version: i32, checked: &Checked| {
            let Ok(uri) = Uri::from_str(file) else { return };
            let lines = Lines::new(&checked.text);
            let diagnostics = actions::problems(&uri, &lines, &checked.found);
            let params = PublishDiagnosticsParams { uri, diagnostics, version: Some(version) };
            publish(Notification::new("textDocument/publishDiagnostics".to_owned(), params).into());
        };
        let (of_derived, answers) = (board.clone(), Arc::clone(&send));
        let late = Arc::clone(&waiting);
        let on_derived = move |file: &str| answer_derived(&late, &of_derived, file, &answers);
        let workers = Workers::start(&board, on_checked, on_derived);
        Server { documents: BTreeMap::new(), board, workers, waiting, deriving: None, send }
    }

    fn is_waited_for(&self) -> bool {
        !self.waiting.lock().unwrap_or_else(PoisonError::into_inner).is_empty()
    }

    /// Answers without equations where these take too long.
    fn answer_late(&self) {
        let mut waiting = self.waiting.lock().unwrap_or_else(PoisonError::into_inner);
        let (late, rest) = waiting.drain(..).partition(|w: &Waiting| w.since.elapsed() > PATIENCE);
        *waiting = rest;
        for Waiting { id, answer, range, .. } in late {
            (self.send)(Response::new_ok(id, shown(answer.text + DERIVING, range)).into());
        }
    }

    fn notification(&mut self, notification: Notification) {
        let Notification { method, params } = notification;
        match method.as_str() {
            "textDocument/didOpen" => {
                let Some(DidOpenTextDocumentParams { text_document }) = read(params) else { return };
                let file = text_document.uri.as_str();
                self.set(file, text_document.text, text_document.version);
                // Whoever opens a model asks for its equations soon.
                if let Some(document) = self.documents.get(file) {
                    self.workers.derive(file, document.version, &document.text);
                }
            }
            "textDocument/didChange" => {
                let Some(DidChangeTextDocumentParams { text_document, content_changes }) = read(params)
                else {
                    return;
                };
                let file = text_document.uri.as_str();
                let Some(mut text) = self.documents.get(file).map(|d| d.text.to_string()) else { return };
                for change in content_changes {
                    match change.range {
                        None => text = change.text,
                        Some(range) => {
                            let lines = Lines::new(&text);
                            let (start, end) = (lines.offset(range.start), lines.offset(range.end));
                            text.replace_range(start..end.max(start), &change.text);
                        }
                    }
                }
                self.set(file, text, text_document.version);
            }
            "textDocument/didClose" => {
                let Some(DidCloseTextDocumentParams { text_document }) = read(params) else { return };
                let file = text_document.uri.as_str();
                self.documents.remove(file);
                self.board.forget(file);
                let params = PublishDiagnosticsParams::new(text_document.uri.clone(), Vec::new(), None);
                (self.send)(Notification::new("textDocument/publishDiagnostics".to_owned(), params).into());
            }
            _ => {}
        }
    }

    fn set(&mut self, file: &str, text: String, version: i32) {
        let document = Document::new(text, version);
        self.workers.check(file, version, &document.text);
        self.documents.insert(file.to_owned(), document);
    }

    fn request(&mut self, request: Request) {
        let Request { id, method, params } = request;
        let answer = match method.as_str() {
            "textDocument/hover" => match self.hover(&id, params) {
                Some(answer) => answer,
                // Somebody else answers.
                None => return,
            },
            "textDocument/completion" => self.about(params, |s, p: CompletionParams| {
                let (_, document, offset) = s.place(&p.text_document_position)?;
                let known = s.known_model(p.text_document_position.text_document.uri.as_str());
                Some(completion::proposals(document, offset, known.as_deref()))
            }),
            "textDocument/definition" => self.about(params, |s, p: GotoDefinitionParams| {
                let (uri, document, offset) = s.place(&p.text_document_position_params)?;
                navigation::definition(document, uri, offset)
            }),
            "textDocument/references" => self.about(params, |s, p: ReferenceParams| {
                let (uri, document, offset) = s.place(&p.text_document_position)?;
                Some(navigation::references(document, uri, offset, p.context.include_declaration))
            }),
            "textDocument/documentHighlight" => self.about(params, |s, p: DocumentHighlightParams| {
                let (_, document, offset) = s.place(&p.text_document_position_params)?;
                Some(navigation::highlights(document, offset))
            }),
            "textDocument/prepareRename" => self.about(params, |s, p: TextDocumentPositionParams| {
                let (_, document, offset) = s.place(&p)?;
                let span = navigation::renamed(document, offset)?;
                let placeholder = document.text.get(span.start..span.end)?.to_owned();
                let range = document.lines().range(span);
                Some(PrepareRenameResponse::RangeWithPlaceholder { range, placeholder })
            }),
            "textDocument/rename" => {
                let Some(p) = read::<RenameParams>(params) else { return self.refuse(id, "no place") };
                let Some((uri, document, offset)) = self.place(&p.text_document_position) else {
                    return self.refuse(id, "the file is not open");
                };
                match navigation::rename(document, uri, offset, &p.new_name) {
                    Ok(edit) => value(edit),
                    Err(reason) => return self.refuse(id, &reason),
                }
            }
            "textDocument/documentSymbol" => self.about(params, |s, p: DocumentSymbolParams| {
                Some(navigation::symbols(s.documents.get(p.text_document.uri.as_str())?))
            }),
            "textDocument/signatureHelp" => self.about(params, |s, p: SignatureHelpParams| {
                let (_, document, offset) = s.place(&p.text_document_position_params)?;
                structure::signature(document, offset)
            }),
            "textDocument/foldingRange" => self.about(params, |s, p: FoldingRangeParams| {
                Some(structure::folds(s.documents.get(p.text_document.uri.as_str())?))
            }),
            "textDocument/codeLens" => self.about(params, |s, p: CodeLensParams| {
                let uri = &p.text_document.uri;
                Some(structure::lenses(s.documents.get(uri.as_str())?, uri))
            }),
            "textDocument/formatting" => self.about(params, |s, p: DocumentFormattingParams| {
                let file = p.text_document.uri.as_str();
                let document = s.documents.get(file)?;
                let formatted = spec::format(file, &document.text).ok()?;
                let is_in_form = formatted == *document.text;
                let edit = TextEdit::new(document.lines().whole(), formatted);
                Some(if is_in_form { Vec::new() } else { vec![edit] })
            }),
            "textDocument/codeAction" => self.about(params, |s, p: CodeActionParams| {
                let uri = &p.text_document.uri;
                let document = s.documents.get(uri.as_str())?;
                let checked = s.board.of(uri.as_str()).checked?;
                let is_of_text = checked.text == document.text;
                let lines = document.lines();
                is_of_text.then(|| actions::repairs(uri, &document.text, &lines, &checked.found, p.range))
            }),
            "textDocument/semanticTokens/full" => self.about(params, |s, p: SemanticTokensParams| {
                let data = navigation::tokens(s.documents.get(p.text_document.uri.as_str())?);
                Some(SemanticTokensResult::Tokens(SemanticTokens { result_id: None, data }))
            }),
            other => {
                let code = ErrorCode::MethodNotFound as i32;
                return (self.send)(Response::new_err(id, code, format!("no `{other}` here")).into());
            }
        };
        (self.send)(Response::new_ok(id, answer).into());
    }

    fn refuse(&self, id: RequestId, reason: &str) {
        let code = ErrorCode::InvalidParams as i32;
        (self.send)(Response::new_err(id, code, reason.to_owned()).into());
    }

    /// The answer to a question; null for none.
    fn about<P: DeserializeOwned, A: Serialize>(
        &self,
        params: Value,
        answer: impl FnOnce(&Server, P) -> Option<A>,
    ) -> Value {
        read(params).and_then(|params| answer(self, params)).map_or(Value::Null, value)
    }

    fn place<'s, 'p>(
        &'s self,
        place: &'p TextDocumentPositionParams,
    ) -> Option<(&'p Uri, &'s Document, usize)> {
        let uri = &place.text_document.uri;
        let document = self.documents.get(uri.as_str())?;
        Some((uri, document, document.lines().offset(place.position)))
    }

    /// The model that a file's text is, or was last.
    fn known_model(&self, file: &str) -> Option<Arc<spec::Model>> {
        self.board.of(file).last_model?.model
    }

    /// What is said about a place; nothing where that waits for equations.
    fn hover(&mut self, id: &RequestId, params: Value) -> Option<Value> {
        let Some(params) = read::<HoverParams>(params) else { return Some(Value::Null) };
        let place = params.text_document_position_params;
        let file = place.text_document.uri.as_str();
        let Some((_, document, offset)) = self.place(&place) else { return Some(Value::Null) };
        let known = self.board.of(file);
        let model = known.last_model.as_ref().and_then(|checked| checked.model.as_deref());
        let Some(answer) = hover::answer(document, offset, model) else { return Some(Value::Null) };
        let range = document.lines().range(answer.span);
        let of_text = known.equations.filter(|(text, _)| *text == document.text);
        // The last model of a text that is none now has equations, but they are not those of the text.
        let is_model = known.last_model.as_ref().is_some_and(|checked| checked.text == document.text);
        if answer.wish == Wish::Nothing || !is_model {
            return Some(value(shown(answer.text, range)));
        }
        if let Some((_, equations)) = of_text {
            let text = equations.map_or_else(|| answer.text.clone(), |e| hover::with_equations(&answer, &e));
            return Some(value(shown(text, range)));
        }
        let (text, version) = (Arc::clone(&document.text), document.version);
        // Who has asked before knows that this takes a while.
        let is_again = self.deriving.as_ref().is_some_and(|(own, of)| own == file && *of == text);
        if is_again {
            return Some(value(shown(answer.text + DERIVING, range)));
        }
        let waiting = Waiting {
            id: id.clone(),
            file: file.to_owned(),
            text: Arc::clone(&text),
            answer,
            range,
            since: Instant::now(),
        };
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner).push(waiting);
        self.workers.derive(file, version, &text);
        self.deriving = Some((file.to_owned(), text));
        None
    }
}

/// Answers those who wait for the equations of a file that are on the board now.
fn answer_derived(waiting: &Mutex<Vec<Waiting>>, board: &Board, file: &str, send: &Send) {
    let Some((text, equations)) = board.of(file).equations else { return };
    let mut waiting = waiting.lock().unwrap_or_else(PoisonError::into_inner);
    let (ready, rest) = waiting.drain(..).partition(|w: &Waiting| w.file == file && w.text == text);
    *waiting = rest;
    drop(waiting);
    for Waiting { id, answer, range, .. } in ready {
        let text = match &equations {
            Some(equations) => hover::with_equations(&answer, equations),
            None => answer.text,
        };
        send(Response::new_ok(id, shown(text, range)).into());
    }
}

fn shown(text: String, range: Range) -> Hover {
    let contents = HoverContents::Markup(MarkupContent { kind: MarkupKind::Markdown, value: text });
    Hover { contents, range: Some(range) }
}

/// Parameters of a message; nothing where they are none of its kind.
fn read<P: DeserializeOwned>(params: Value) -> Option<P> {
    serde_json::from_value(params).ok()
}

fn value<A: Serialize>(answer: A) -> Value {
    serde_json::to_value(answer).unwrap_or(Value::Null)
}
