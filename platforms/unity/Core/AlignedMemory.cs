using System;
using System.Runtime.InteropServices;
using System.Threading;

namespace DCloth
{
    /// <summary>A block outside of the garbage collector's heap, on a multiple of DCLOTH_ALIGNMENT, zeroed. What is
    /// lent to the engine: it never moves.
    /// Thread: Dispose once, after the last use.</summary>
    public sealed unsafe class AlignedMemory : IDisposable
    {
        private static long liveBytes;
        private IntPtr block;

        /// <summary>Throws ArgumentOutOfRangeException below 0, OutOfMemoryException where the system has no
        /// more.</summary>
        public AlignedMemory(long size)
        {
            if (size < 0) throw new ArgumentOutOfRangeException(nameof(size), size, "bytes to lend: 0 or more");
            block = Marshal.AllocHGlobal(new IntPtr(size + Native.DCLOTH_ALIGNMENT));
            Size = size;
            Interlocked.Add(ref liveBytes, size);
            long address = block.ToInt64();
            Start = (byte*)(address + (Native.DCLOTH_ALIGNMENT - 1) & ~(long)(Native.DCLOTH_ALIGNMENT - 1));
            Clear();
        }

        ~AlignedMemory()
        {
            Free();
        }

        /// <summary>Bytes of all blocks that are not given back yet.</summary>
        public static long LiveBytes => Interlocked.Read(ref liveBytes);

        /// <summary>Null after Dispose.</summary>
        public byte* Start { get; private set; }

        public long Size { get; }

        public static AlignedMemory CopyOf(byte[] bytes)
        {
            if (bytes == null) throw new ArgumentNullException(nameof(bytes));
            var memory = new AlignedMemory(bytes.LongLength);
            if (bytes.Length > 0) Marshal.Copy(bytes, 0, (IntPtr)memory.Start, bytes.Length);
            return memory;
        }

        public void Dispose()
        {
            Free();
            GC.SuppressFinalize(this);
        }

        private void Clear()
        {
            for (long i = 0; i < Size / sizeof(ulong); ++i) ((ulong*)Start)[i] = 0;
            for (long i = Size / sizeof(ulong) * sizeof(ulong); i < Size; ++i) Start[i] = 0;
        }

        private void Free()
        {
            if (block == IntPtr.Zero) return;
            Marshal.FreeHGlobal(block);
            Interlocked.Add(ref liveBytes, -Size);
            block = IntPtr.Zero;
            Start = null;
        }
    }
}
