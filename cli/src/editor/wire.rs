//! Messages on standard input and output, with bounds on what an editor can make this process keep.
//!
//! Does not know: what messages say.

use std::io::{self, BufRead, ErrorKind, Read as _};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;

use lsp_server::{Connection, Message};

/// Most bytes of a message: far more than a model may have.
const MAX_BYTES: u64 = 1 << 26;
/// Most bytes of a line of a header.
const MAX_HEADER: u64 = 1 << 12;

/// Why no more messages come, where that is no end in order.
#[derive(Clone, Debug, Default)]
pub(super) struct Broken(Arc<Mutex<Option<String>>>);

impl Broken {
    fn note(&self, error: &io::Error) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(error.to_string());
    }

    /// The reason.
    pub(super) fn reason(&self) -> Option<String> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

/// The conversation over standard input and output.
pub(super) fn stdio() -> (Connection, Broken) {
    let (here, there) = Connection::memory();
    let Connection { sender, receiver } = there;
    let broken = Broken::default();
    let noted = broken.clone();
    thread::spawn(move || {
        let mut input = io::stdin().lock();
        loop {
            match read(&mut input) {
                Ok(Some(message)) => {
                    let is_last = matches!(&message, Message::Notification(n) if n.method == "exit");
                    if sender.send(message).is_err() || is_last {
                        return;
                    }
                }
                Ok(None) => return,
                Err(error) => return noted.note(&error),
            }
        }
    });
    thread::spawn(move || {
        let mut output = io::stdout().lock();
        // An editor that has gone hears nothing.
        receiver.into_iter().try_for_each(|message| message.write(&mut output))
    });
    (here, broken)
}

fn wrong(reason: impl Into<String>) -> io::Error {
    io::Error::new(ErrorKind::InvalidData, reason.into())
}

/// The next message; none at the end of the input.
fn read(input: &mut impl BufRead) -> io::Result<Option<Message>> {
    let mut size: Option<u64> = None;
    loop {
        let mut line = String::new();
        if input.take(MAX_HEADER).read_line(&mut line)? == 0 {
            return Ok(None);
        }
        let Some(line) = line.strip_suffix("\r\n") else {
            return Err(wrong(format!("{:?} is no line of a header", cut(&line))));
        };
        if line.is_empty() {
            break;
        }
        let Some((name, value)) = line.split_once(": ") else {
            return Err(wrong(format!("{:?} is no line of a header", cut(line))));
        };
        if name.eq_ignore_ascii_case("Content-Length") {
            let number = value.parse().map_err(|e| wrong(format!("Content-Length {value:?}: {e}")))?;
            size = Some(number);
        }
    }
    let size = size.ok_or_else(|| wrong("a message has no Content-Length"))?;
    if size > MAX_BYTES {
        return Err(wrong(format!("a message has {size} bytes, and at most {MAX_BYTES} are read")));
    }
    // Room is made for bytes that come, not for those that are promised.
    let mut bytes = Vec::new();
    if input.take(size).read_to_end(&mut bytes)? as u64 != size {
        return Err(ErrorKind::UnexpectedEof.into());
    }
    serde_json::from_slice(&bytes).map(Some).map_err(|e| wrong(format!("a message is malformed: {e}")))
}

/// The beginning of a text.
fn cut(text: &str) -> String {
    text.chars().take(60).collect()
}

#[cfg(test)]
mod tests {
    use super::read;

    #[test]
    fn messages_are_read_and_what_is_none_is_told() {
        let text = r#"{"jsonrpc": "2.0", "method": "exit"}"#;
        let whole = format!("content-length: {}\r\nOther: x\r\n\r\n{text}", text.len());
        assert!(read(&mut whole.as_bytes()).unwrap().is_some());
        assert!(read(&mut &b""[..]).unwrap().is_none());
        let long = "a".repeat(1 << 20);
        let cases = [
            ("Content-Length: 99999999999999\r\n\r\n{", "99999999999999 bytes, and at most"),
            ("Content-Length: 99999999999999999999999\r\n\r\n{", "too large"),
            ("Content-Length: -1\r\n\r\n{", "invalid digit"),
            ("Content-Length: 10\r\n\r\n{", "unexpected end of file"),
            ("Content-Length: 1\r\n\r\n{", "malformed"),
            ("Other: 1\r\n\r\n{", "no Content-Length"),
            ("Content-Length 1\r\n\r\n{", "is no line of a header"),
            (&long, "is no line of a header"),
        ];
        for (text, reason) in cases {
            let error = read(&mut text.as_bytes()).unwrap_err().to_string();
            assert!(error.contains(reason) && error.len() < 200, "{text:.40}: {error}");
        }
    }
}
