//! Numbers of a glTF file: what an accessor stands for, checked against the bytes that there are.

use gltf::json::accessor::sparse::Sparse;
use gltf::json::accessor::{ComponentType, Type};
use gltf::json::buffer::View;
use gltf::json::validation::Checked;
use gltf::json::{Accessor, Index};

use super::document::Document;
use crate::Result;

/// How numbers are stored.
#[derive(Clone, Copy)]
struct Format {
    component: ComponentType,
    /// Integers are parts of 1.
    normalized: bool,
}

impl Document {
    /// The elements of an accessor, of `N` numbers each. One without a buffer view holds zeros, under what is sparse; that is refused
    /// where neither anything is sparse nor their `count` is told.
    ///
    /// # Errors
    /// [`Error::Input`](crate::Error::Input) where the accessor is of another shape, or not of `count`, its bytes are not there, or one of its
    /// numbers is not finite.
    pub fn numbers<const N: usize>(
        &self,
        index: Index<Accessor>,
        count: Option<usize>,
    ) -> Result<Vec<[f64; N]>> {
        let accessor = self.get(index, "accessor")?;
        self.numbers_of(accessor, count).map_err(|error| error.of(&format!("accessor {index}")))
    }

    fn numbers_of<const N: usize>(&self, accessor: &Accessor, count: Option<usize>) -> Result<Vec<[f64; N]>> {
        let (Checked::Valid(shape), Checked::Valid(component)) = (accessor.type_, accessor.component_type)
        else {
            return Err(self.error("its type is none that there is"));
        };
        if shape.multiplicity() != N || matches!(shape, Type::Mat2 | Type::Mat3) {
            return Err(self.error(format!("it holds elements of type {shape:?}, not of {N} numbers")));
        }
        let own = accessor.count.0;
        if let Some(count) = count.filter(|count| *count as u64 != own) {
            return Err(self.error(format!("it holds {own} elements, but should hold {count}")));
        }
        let format = Format { component: component.0, normalized: accessor.normalized };
        let offset = accessor.byte_offset.unwrap_or_default().0;
        let mut numbers = match (accessor.buffer_view, count) {
            (Some(view), _) => self.stored(view, offset, own, format)?,
            (None, None) if accessor.sparse.is_none() => {
                return Err(self.error("it has no buffer view, in which its numbers would be"));
            }
            (None, _) => {
                self.spend(own.saturating_mul(N as u64))?;
                vec![[0.0; N]; own as usize]
            }
        };
        if let Some(sparse) = &accessor.sparse {
            self.lay_over(sparse, format, &mut numbers)?;
        }
        match numbers.iter().position(|element| !element.iter().all(|x| x.is_finite())) {
            Some(id) => Err(self.error(format!("element {id} is {:?}, which is not finite", numbers[id]))),
            None => Ok(numbers),
        }
    }

    /// Whole numbers below `end`, each of which stands for a `what`.
    ///
    /// # Errors
    /// As [`Document::numbers`], and where one is out of range.
    pub fn indices<const N: usize>(
        &self,
        index: Index<Accessor>,
        count: Option<usize>,
        end: usize,
        what: &str,
    ) -> Result<Vec<[u32; N]>> {
        let numbers = self.numbers::<N>(index, count)?;
        let is_index = |x: &f64| *x >= 0.0 && *x < end as f64 && x.fract() == 0.0;
        if let Some(bad) = numbers.iter().flatten().find(|x| !is_index(x)) {
            let message = format!("accessor {index}: it names the {what} {bad}, but there are {end}");
            return Err(self.error(message));
        }
        Ok(numbers.into_iter().map(|element| element.map(|x| x as u32)).collect())
    }

    /// Replaces the elements that a sparse accessor says to.
    fn lay_over<const N: usize>(
        &self,
        sparse: &Sparse,
        format: Format,
        numbers: &mut [[f64; N]],
    ) -> Result<()> {
        let Sparse { count, indices, values, .. } = sparse;
        let Checked::Valid(index_type) = indices.component_type else {
            return Err(self.error("the type of its sparse indices is none that there is"));
        };
        let index_format = Format { component: index_type.0, normalized: false };
        let ids = self.stored::<1>(indices.buffer_view, indices.byte_offset.0, count.0, index_format)?;
        let values = self.stored::<N>(values.buffer_view, values.byte_offset.0, count.0, format)?;
        for ([id], value) in ids.into_iter().zip(values) {
            let count = numbers.len();
            let element = numbers.get_mut(id as usize);
            *element.ok_or_else(|| self.error(format!("its sparse index {id} is not below {count}")))? =
                value;
        }
        Ok(())
    }

    /// `count` elements that begin `offset` bytes into a view.
    fn stored<const N: usize>(
        &self,
        index: Index<View>,
        offset: u64,
        count: u64,
        format: Format,
    ) -> Result<Vec<[f64; N]>> {
        let view = self.get(index, "buffer view")?;
        let component = format.component.size();
        let size = N * component;
        let stride = view.byte_stride.map_or(size, |stride| stride.0);
        if stride < size {
            let message =
                format!("buffer view {index} has a stride of {stride} for elements of {size} bytes");
            return Err(self.error(message));
        }
        let buffer = self.buffers.get(view.buffer.value()).map(Vec::as_slice);
        let bytes = buffer
            .and_then(|bytes| slice(bytes, view.byte_offset.unwrap_or_default().0, view.byte_length.0))
            .ok_or_else(|| {
                self.error(format!("buffer view {index} reaches beyond the end of buffer {}", view.buffer))
            })?;
        let length = match count.checked_sub(1) {
            None => Some(0),
            Some(before) => {
                before.checked_mul(stride as u64).and_then(|bytes| bytes.checked_add(size as u64))
            }
        };
        let bytes = length.and_then(|length| slice(bytes, offset, length)).ok_or_else(|| {
            self.error(format!("its {count} elements reach beyond the end of buffer view {index}"))
        })?;
        self.spend(count * N as u64)?;
        let number = |at: usize| format.number(&bytes[at..at + component]);
        let element = |id: usize| std::array::from_fn(|k| number(id * stride + k * component));
        Ok((0..count as usize).map(element).collect())
    }
}

fn slice(bytes: &[u8], start: u64, length: u64) -> Option<&[u8]> {
    let end = start.checked_add(length)?;
    bytes.get(usize::try_from(start).ok()?..usize::try_from(end).ok()?)
}

impl Format {
    fn number(self, bytes: &[u8]) -> f64 {
        let (number, most) = match (self.component, bytes) {
            (ComponentType::I8, &[a]) => (f64::from(a as i8), f64::from(i8::MAX)),
            (ComponentType::U8, &[a]) => (f64::from(a), f64::from(u8::MAX)),
            (ComponentType::I16, &[a, b]) => (f64::from(i16::from_le_bytes([a, b])), f64::from(i16::MAX)),
            (ComponentType::U16, &[a, b]) => (f64::from(u16::from_le_bytes([a, b])), f64::from(u16::MAX)),
            (ComponentType::U32, &[a, b, c, d]) => {
                (f64::from(u32::from_le_bytes([a, b, c, d])), f64::from(u32::MAX))
            }
            (ComponentType::F32, &[a, b, c, d]) => return f64::from(f32::from_le_bytes([a, b, c, d])),
            _ => unreachable!("there are as many bytes as the component has"),
        };
        if self.normalized { (number / most).max(-1.0) } else { number }
    }
}
