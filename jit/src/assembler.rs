//! Instructions of AVX2 as bytes, in the calling convention of x86-64 but on Windows.
//!
//! Deliberately does not know: programs, which register a value is in.
//!
//! # Source
//! Intel 64 and IA-32 Architectures Software Developer's Manual, volume 2: the VEX prefix (section 2.3), and each
//! instruction by name.

use crate::translate::Pointer;

/// Where an operand is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Place {
    /// In a register of four numbers.
    Register(usize),
    /// On the stack, so many bytes from its top.
    Stack(usize),
    /// In a vector, so many bytes from its start.
    Number(Pointer, usize),
}

impl Place {
    /// The register that it is.
    pub(crate) fn register(self) -> usize {
        match self {
            Place::Register(register) => register,
            other => unreachable!("{other:?} is no register"),
        }
    }
}

/// An operation on two operands, lane by lane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Binary {
    Add,
    Sub,
    Mul,
    Div,
    And,
    Xor,
    /// The sum of the bits as whole numbers.
    AddBits,
}

impl Binary {
    pub(crate) fn commutes(self) -> bool {
        !matches!(self, Binary::Sub | Binary::Div)
    }

    fn opcode(self) -> u8 {
        match self {
            Binary::Add => 0x58,
            Binary::Sub => 0x5c,
            Binary::Mul => 0x59,
            Binary::Div => 0x5e,
            Binary::And => 0x54,
            Binary::Xor => 0x57,
            Binary::AddBits => 0xd4,
        }
    }
}

/// Maps of opcodes.
const MAP_0F: u8 = 1;
const MAP_0F38: u8 = 2;
const MAP_0F3A: u8 = 3;

/// The field of an operand that an instruction does not have.
const NO_REGISTER: usize = 0;

/// Bytes of the smallest guard behind a stack.
const PAGE: usize = 4096;

const RSP: u8 = 4;
const RAX: u8 = 0;
const R10: u8 = 10;

/// Code that is being written. The pointers are in the registers of the first six arguments; the last two are loaded
/// from the stack at the start.
#[derive(Default)]
pub(crate) struct Assembler {
    body: Vec<u8>,
    /// Places behind the offsets of jumps to the end of the code that gives up.
    jumps: Vec<usize>,
}

/// The register of a pointer.
fn base(pointer: Pointer) -> u8 {
    match pointer {
        Pointer::State => 7,
        Pointer::Out => 6,
        Pointer::Prepared => 2,
        Pointer::Constants => 1,
        Pointer::Params => 8,
        Pointer::Time => 9,
        Pointer::Argument => RAX,
        Pointer::Scalars => R10,
    }
}

impl Assembler {
    /// An instruction on 256 bits with the prefix 66: `register` and `second` are registers, `operand` either.
    fn vex(&mut self, (map, opcode): (u8, u8), register: usize, second: usize, operand: Place) {
        let (is_memory, rm, offset) = match operand {
            Place::Register(register) => (false, register as u8, 0),
            Place::Stack(offset) => (true, RSP, offset),
            Place::Number(pointer, offset) => (true, base(pointer), offset),
        };
        let high = |register: u8| if register & 8 == 0 { 1_u8 } else { 0 };
        let register = register as u8;
        self.body.extend([0xc4, high(register) << 7 | 1 << 6 | high(rm) << 5 | map]);
        // W0, the second register inverted, 256 bits, the prefix 66.
        self.body.extend([(!(second as u8) & 15) << 3 | 1 << 2 | 1, opcode]);
        let fields = (register & 7) << 3 | rm & 7;
        if !is_memory {
            self.body.push(0b1100_0000 | fields);
            return;
        }
        self.body.push(0b1000_0000 | fields);
        if rm & 7 == RSP {
            self.body.push(0x24);
        }
        // Programs have far fewer numbers than 32 bits count.
        self.body.extend((offset as u32).to_le_bytes());
    }

    pub(crate) fn binary(&mut self, operation: Binary, to: usize, first: usize, second: Place) {
        self.vex((MAP_0F, operation.opcode()), to, first, second);
    }

    /// `vsqrtpd`
    pub(crate) fn root(&mut self, to: usize, from: Place) {
        self.vex((MAP_0F, 0x51), to, NO_REGISTER, from);
    }

    /// `vpsllq`
    pub(crate) fn shift(&mut self, to: usize, from: usize, bits: u8) {
        // The register of the result is the second operand; in its place is a part of the opcode.
        self.vex((MAP_0F, 0x73), 6, to, Place::Register(from));
        self.body.push(bits);
    }

    /// `vblendvpd`
    pub(crate) fn choose(&mut self, to: usize, first: usize, second: Place, by_sign_of: usize) {
        self.vex((MAP_0F3A, 0x4b), to, first, second);
        self.body.push((by_sign_of as u8) << 4);
    }

    /// `vmovupd`
    pub(crate) fn load(&mut self, to: usize, from: Place) {
        self.vex((MAP_0F, 0x10), to, NO_REGISTER, from);
    }

    /// `vmovupd`
    pub(crate) fn store(&mut self, from: usize, to: Place) {
        self.vex((MAP_0F, 0x11), from, NO_REGISTER, to);
    }

    /// Gives up where a lane of the first is larger than the second: `vcmppd`, `vtestpd`, `jnz`.
    pub(crate) fn guard(&mut self, scratch: usize, first: usize, second: Place) {
        const GREATER: u8 = 0x1e;
        self.vex((MAP_0F, 0xc2), scratch, first, second);
        self.body.push(GREATER);
        self.vex((MAP_0F38, 0x0f), scratch, NO_REGISTER, Place::Register(scratch));
        self.body.extend([0x0f, 0x85, 0, 0, 0, 0]);
        self.jumps.push(self.body.len());
    }

    /// Bytes so far.
    pub(crate) fn len(&self) -> usize {
        self.body.len()
    }

    /// A function that returns zero, or one where it gives up, with so many bytes of the stack.
    pub(crate) fn finish(self, n_bytes: usize) -> Vec<u8> {
        self.framed(n_bytes, &[])
    }

    /// The same of code in a loop, which begins at a byte the first time and runs as often as the last pointer, a
    /// number, says.
    pub(crate) fn finish_loop(mut self, n_bytes: usize, second: usize) -> Vec<u8> {
        // dec r10; jnz to the start of the code
        self.body.extend([0x49, 0xff, 0xca, 0x0f, 0x85]);
        let distance = -((self.body.len() + 4) as i32);
        self.body.extend(distance.to_le_bytes());
        // jmp
        let mut entry = vec![0xe9];
        entry.extend((second as u32).to_le_bytes());
        self.framed(n_bytes, &entry)
    }

    /// A function with something before its code.
    fn framed(mut self, n_bytes: usize, entry: &[u8]) -> Vec<u8> {
        // mov rax, [rsp + 8]; mov r10, [rsp + 16]
        let mut code = vec![0x48, 0x8b, 0x44, 0x24, 8, 0x4c, 0x8b, 0x54, 0x24, 16];
        // Each page is touched in its turn, so that none beyond the guard of the stack is: or qword [rsp - distance], 0
        for page in 1..=n_bytes / PAGE {
            code.extend([0x48, 0x83, 0x8c, 0x24]);
            code.extend((-((page * PAGE) as i32)).to_le_bytes());
            code.push(0);
        }
        let n_bytes = (n_bytes as u32).to_le_bytes();
        // sub rsp, n_bytes
        code.extend([0x48, 0x81, 0xec]);
        code.extend(n_bytes);
        code.extend(entry);
        // vzeroupper; add rsp, n_bytes; mov eax, answer; ret
        let end = |answer: u8| {
            let mut end = vec![0xc5, 0xf8, 0x77, 0x48, 0x81, 0xc4];
            end.extend(n_bytes);
            end.extend([0xb8, answer, 0, 0, 0, 0xc3]);
            end
        };
        self.body.extend(end(0));
        let given_up = self.body.len();
        for at in self.jumps {
            let distance = (given_up - at) as u32;
            self.body[at - 4..at].copy_from_slice(&distance.to_le_bytes());
        }
        self.body.extend(end(1));
        code.extend(self.body);
        code
    }
}
