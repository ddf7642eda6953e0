//! Instructions of AVX2 and AVX-512 as bytes, in the calling convention of x86-64 but on Windows.
//!
//! Deliberately does not know: programs, which register a value is in.
//!
//! # Source
//! Intel 64 and IA-32 Architectures Software Developer's Manual, volume 2: the VEX prefix (section 2.3), the EVEX
//! prefix (section 2.7), and each instruction by name.

use crate::lanes::Encoding;
use crate::translate::Pointer;

/// Where an operand is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Place {
    /// In a register.
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

/// Prefixes.
const PREFIX_66: u8 = 1;
const PREFIX_F3: u8 = 2;

/// The field of an operand that an instruction does not have.
const NO_REGISTER: usize = 0;

/// The register of masks that instructions use.
const MASK: usize = 1;

/// Bytes of the largest register.
const LINE: usize = 64;

/// Bytes of the smallest guard behind a stack.
const PAGE: usize = 4096;

const RSP: u8 = 4;
const RAX: u8 = 0;
const R10: u8 = 10;

/// Code that is being written. The pointers are in the registers of the first six arguments; the last two are loaded
/// from the stack at the start.
pub(crate) struct Assembler {
    encoding: Encoding,
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

/// The field of an operand that is a register or in memory: whether it is in memory, the number of its register, and
/// bytes from there.
fn field(operand: Place) -> (bool, u8, usize) {
    match operand {
        Place::Register(register) => (false, register as u8, 0),
        Place::Stack(offset) => (true, RSP, offset),
        Place::Number(pointer, offset) => (true, base(pointer), offset),
    }
}

/// Whether a bit of the number of a register is zero, as prefixes have it.
fn inverted(register: u8, bit: u8) -> u8 {
    u8::from(register & bit == 0)
}

impl Assembler {
    pub(crate) fn new(encoding: Encoding) -> Assembler {
        Assembler { encoding, body: Vec::new(), jumps: Vec::new() }
    }

    /// An instruction on a whole register with the prefix 66: `register` and `second` are registers, `operand` either.
    fn write(&mut self, opcode: (u8, u8), register: usize, second: usize, operand: Place) {
        match self.encoding {
            Encoding::Vex => self.vex(opcode, register, second, operand),
            Encoding::EvexOfFour | Encoding::EvexOfEight => {
                self.evex((PREFIX_66, opcode), register, second, operand, 0);
            }
        }
    }

    /// One with the prefix VEX, on 256 bits.
    fn vex(&mut self, (map, opcode): (u8, u8), register: usize, second: usize, operand: Place) {
        let (_, rm, _) = field(operand);
        let register = register as u8;
        self.body.extend([0xc4, inverted(register, 8) << 7 | 1 << 6 | inverted(rm, 8) << 5 | map]);
        // W0, the second register inverted, 256 bits, the prefix 66.
        self.body.extend([(!(second as u8) & 15) << 3 | 1 << 2 | PREFIX_66, opcode]);
        self.operands(register, operand);
    }

    /// One with the prefix EVEX, on numbers of 64 bits, and with a mask other than zero by that.
    fn evex(
        &mut self,
        (prefix, (map, opcode)): (u8, (u8, u8)),
        register: usize,
        second: usize,
        operand: Place,
        mask: usize,
    ) {
        let (is_memory, rm, _) = field(operand);
        let (register, second) = (register as u8, second as u8);
        // The fifth bit of a register stands where an index of memory has its fourth.
        let fifth = if is_memory { 1 } else { inverted(rm, 16) };
        self.body.extend([
            0x62,
            inverted(register, 8) << 7
                | fifth << 6
                | inverted(rm, 8) << 5
                | inverted(register, 16) << 4
                | map,
            1 << 7 | (!second & 15) << 3 | 1 << 2 | prefix,
            u8::from(self.encoding == Encoding::EvexOfEight) << 6
                | u8::from(self.encoding == Encoding::EvexOfFour) << 5
                | inverted(second, 16) << 3
                | mask as u8,
            opcode,
        ]);
        self.operands(register, operand);
    }

    /// The bytes behind an opcode that name its operands.
    fn operands(&mut self, register: u8, operand: Place) {
        let (is_memory, rm, offset) = field(operand);
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
        self.write((MAP_0F, operation.opcode()), to, first, second);
    }

    /// `vsqrtpd`
    pub(crate) fn root(&mut self, to: usize, from: Place) {
        self.write((MAP_0F, 0x51), to, NO_REGISTER, from);
    }

    /// `vpsllq`
    pub(crate) fn shift(&mut self, to: usize, from: usize, bits: u8) {
        // The register of the result is the second operand; in its place is a part of the opcode.
        self.write((MAP_0F, 0x73), 6, to, Place::Register(from));
        self.body.push(bits);
    }

    /// `vblendvpd`; with masks `vpmovq2m`, `vblendmpd`.
    pub(crate) fn choose(&mut self, to: usize, first: usize, second: Place, by_sign_of: usize) {
        if self.encoding == Encoding::Vex {
            self.vex((MAP_0F3A, 0x4b), to, first, second);
            self.body.push((by_sign_of as u8) << 4);
            return;
        }
        let sign = Place::Register(by_sign_of);
        self.evex((PREFIX_F3, (MAP_0F38, 0x39)), MASK, NO_REGISTER, sign, 0);
        self.evex((PREFIX_66, (MAP_0F38, 0x65)), to, first, second, MASK);
    }

    /// `vmovupd`
    pub(crate) fn load(&mut self, to: usize, from: Place) {
        self.write((MAP_0F, 0x10), to, NO_REGISTER, from);
    }

    /// `vmovupd`
    pub(crate) fn store(&mut self, from: usize, to: Place) {
        self.write((MAP_0F, 0x11), from, NO_REGISTER, to);
    }

    /// Gives up where a lane of the first is larger than the second: `vcmppd`, `vtestpd` or with masks `kortestw`,
    /// `jnz`.
    pub(crate) fn guard(&mut self, scratch: usize, first: usize, second: Place) {
        const GREATER: u8 = 0x1e;
        let is_vex = self.encoding == Encoding::Vex;
        self.write((MAP_0F, 0xc2), if is_vex { scratch } else { MASK }, first, second);
        self.body.push(GREATER);
        match is_vex {
            true => self.vex((MAP_0F38, 0x0f), scratch, NO_REGISTER, Place::Register(scratch)),
            false => self.body.extend([0xc5, 0xf8, 0x98, 0b1100_0000 | (MASK << 3 | MASK) as u8]),
        }
        self.body.extend([0x0f, 0x85, 0, 0, 0, 0]);
        self.jumps.push(self.body.len());
    }

    pub(crate) fn encoding(&self) -> Encoding {
        self.encoding
    }

    /// Bytes so far.
    pub(crate) fn len(&self) -> usize {
        self.body.len()
    }

    /// A function that returns zero, or one where it gives up, with so many bytes of the stack.
    pub(crate) fn finish(self, n_bytes: usize) -> Vec<u8> {
        self.framed(n_bytes, &[])
    }

    /// Ends a loop of all code so far, which runs as often as the last pointer, a number, says.
    pub(crate) fn end_loop(&mut self) {
        // dec r10; jnz to the start of the code
        self.body.extend([0x49, 0xff, 0xca, 0x0f, 0x85]);
        let distance = -((self.body.len() + 4) as i32);
        self.body.extend(distance.to_le_bytes());
    }

    /// As [`finish`](Self::finish) of code that begins at a byte, behind an entry.
    pub(crate) fn finish_loop(self, n_bytes: usize, entry: &Assembler, first: usize) -> Vec<u8> {
        let mut entry = entry.body.clone();
        // jmp
        entry.push(0xe9);
        entry.extend((first as u32).to_le_bytes());
        self.framed(n_bytes, &entry)
    }

    /// A function with something before its code.
    fn framed(mut self, n_bytes: usize, entry: &[u8]) -> Vec<u8> {
        // mov rax, [rsp + 8]; mov r10, [rsp + 16]; mov r11, rsp
        let mut code = vec![0x48, 0x8b, 0x44, 0x24, 8, 0x4c, 0x8b, 0x54, 0x24, 16, 0x49, 0x89, 0xe3];
        // The places of the stack are aligned, as registers are.
        let n_bytes = n_bytes + LINE;
        // Each page is touched in its turn, so that none beyond the guard of the stack is: or qword [rsp - distance], 0
        for page in 1..=n_bytes / PAGE {
            code.extend([0x48, 0x83, 0x8c, 0x24]);
            code.extend((-((page * PAGE) as i32)).to_le_bytes());
            code.push(0);
        }
        // sub rsp, n_bytes; and rsp, -LINE
        code.extend([0x48, 0x81, 0xec]);
        code.extend((n_bytes as u32).to_le_bytes());
        code.extend([0x48, 0x83, 0xe4, (LINE as u8).wrapping_neg()]);
        code.extend(entry);
        // vzeroupper; mov rsp, r11; mov eax, answer; ret
        let end = |answer: u8| [0xc5, 0xf8, 0x77, 0x4c, 0x89, 0xdc, 0xb8, answer, 0, 0, 0, 0xc3];
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
