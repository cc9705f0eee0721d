//! The types of numbers in VTK files, legacy and XML.
//!
//! Both formats have equal types under different names. Values of fields become doubles: integers beyond 2^53 are
//! rounded. Points of cells stay integers. Linear.

/// The type of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// One bit; packed eight to a byte in binary files, the first one highest.
    Bit,
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Kind {
    /// The type with a name of the legacy format. `long` has eight bytes, as on all systems but Windows.
    pub(crate) fn of_legacy(name: &[u8]) -> Option<Self> {
        Some(match name.to_ascii_lowercase().as_slice() {
            b"bit" => Self::Bit,
            b"char" | b"signed_char" => Self::I8,
            b"unsigned_char" => Self::U8,
            b"short" => Self::I16,
            b"unsigned_short" => Self::U16,
            // The VTK library writes its ids with four bytes, independent of their size in memory.
            b"int" | b"vtkidtype" => Self::I32,
            b"unsigned_int" => Self::U32,
            b"long" | b"vtktypeint64" => Self::I64,
            b"unsigned_long" | b"vtktypeuint64" => Self::U64,
            b"float" => Self::F32,
            b"double" => Self::F64,
            _ => return None,
        })
    }

    /// The type with a name of the XML formats.
    pub(crate) fn of_xml(name: &str) -> Option<Self> {
        Some(match name {
            "Bit" => Self::Bit,
            "Int8" => Self::I8,
            "UInt8" => Self::U8,
            "Int16" => Self::I16,
            "UInt16" => Self::U16,
            "Int32" => Self::I32,
            "UInt32" => Self::U32,
            "Int64" => Self::I64,
            "UInt64" => Self::U64,
            "Float32" => Self::F32,
            "Float64" => Self::F64,
            _ => return None,
        })
    }

    pub(crate) fn is_real(self) -> bool {
        matches!(self, Self::F32 | Self::F64)
    }

    /// The number of bytes of this many numbers.
    pub(crate) fn bytes(self, count: usize) -> Option<usize> {
        match self {
            Self::Bit => Some(count.div_ceil(8)),
            _ => count.checked_mul(self.size()),
        }
    }

    fn size(self) -> usize {
        match self {
            Self::Bit | Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    /// The first `count` numbers of the bytes as doubles.
    pub(crate) fn reals(self, bytes: &[u8], count: usize, big_endian: bool) -> Vec<f64> {
        let real = |bits| match self {
            Self::F32 => f64::from(f32::from_bits(low(bits))),
            Self::F64 => f64::from_bits(bits),
            Self::Bit | Self::U8 | Self::U16 | Self::U32 | Self::U64 => bits as f64,
            Self::I8 | Self::I16 | Self::I32 | Self::I64 => self.signed(bits) as f64,
        };
        self.numbers(bytes, count, big_endian).map(real).collect()
    }

    /// The first `count` numbers of the bytes as numbers from 0 on.
    ///
    /// # Errors
    /// The index of the first number that is negative, too large or not of an integer type.
    pub(crate) fn indices(
        self,
        bytes: &[u8],
        count: usize,
        big_endian: bool,
    ) -> Result<Vec<usize>, usize> {
        let index = |bits| match self {
            Self::I8 | Self::I16 | Self::I32 | Self::I64 => usize::try_from(self.signed(bits)).ok(),
            Self::F32 | Self::F64 => None,
            _ => usize::try_from(bits).ok(),
        };
        // Not `collect`, which would start small and grow: the size is known.
        let mut indices = Vec::with_capacity(count);
        for (i, bits) in self.numbers(bytes, count, big_endian).enumerate() {
            indices.push(index(bits).ok_or(i)?);
        }
        Ok(indices)
    }

    fn signed(self, bits: u64) -> i64 {
        let unused = 64 - 8 * self.size();
        (bits << unused).cast_signed() >> unused
    }

    /// The bits of each number, in the lowest positions. The bytes must be enough.
    fn numbers(
        self,
        bytes: &[u8],
        count: usize,
        big_endian: bool,
    ) -> impl ExactSizeIterator<Item = u64> {
        let size = self.size();
        (0..count).map(move |i| {
            if self == Self::Bit {
                return u64::from(bytes[i / 8] >> (7 - i % 8) & 1);
            }
            let number = &bytes[i * size..][..size];
            let mut padded = [0; 8];
            if big_endian {
                padded[8 - size..].copy_from_slice(number);
                u64::from_be_bytes(padded)
            } else {
                padded[..size].copy_from_slice(number);
                u64::from_le_bytes(padded)
            }
        })
    }
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "the lower half is what is asked for"
)]
fn low(bits: u64) -> u32 {
    bits as u32
}
