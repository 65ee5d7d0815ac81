#include "DClothModel.h"

THIRD_PARTY_INCLUDES_START
#include "garment/garment.h"
THIRD_PARTY_INCLUDES_END

FString UDClothModel::SetBytes(const TArray<uint8>& NewBytes) {
  Bytes = NewBytes;
  Opened.reset();
  FString Error;
  Open(Error);
  return Error;
}

std::shared_ptr<const dcloth::platforms::GarmentModel> UDClothModel::Open(FString& OutError) {
  if (Opened == nullptr) {
    std::string Error;
    Opened = dcloth::platforms::GarmentModel::Open(Bytes.GetData(), static_cast<size_t>(Bytes.Num()), &Error);
    OutError = UTF8_TO_TCHAR(Error.c_str());
  }
  return Opened;
}
