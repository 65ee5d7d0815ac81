#include "DClothModelFactory.h"

#include "DClothModel.h"
#include "Misc/FeedbackContext.h"

UDClothModelFactory::UDClothModelFactory() {
  SupportedClass = UDClothModel::StaticClass();
  bCreateNew = false;
  bEditorImport = true;
  Formats.Add(TEXT("dcloth;Learned cloth"));
}

UObject* UDClothModelFactory::FactoryCreateBinary(UClass* Class, UObject* Parent, FName Name, EObjectFlags Flags,
                                                  UObject*, const TCHAR*, const uint8*& Buffer, const uint8* BufferEnd,
                                                  FFeedbackContext* Warn) {
  UDClothModel* const Model = NewObject<UDClothModel>(Parent, Class, Name, Flags);
  const FString Error = Model->SetBytes(TArray<uint8>(Buffer, static_cast<int32>(BufferEnd - Buffer)));
  if (Error.IsEmpty()) return Model;
  Warn->Logf(ELogVerbosity::Error, TEXT("%s: %s"), *Name.ToString(), *Error);
  return nullptr;
}
